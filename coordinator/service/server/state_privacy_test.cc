// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/server/state_privacy.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "tests/support/temporary_path.h"

namespace sheaf::coordinator {
namespace {

namespace fs = std::filesystem;

class StatePrivacyTest : public ::testing::Test {
 protected:
  StatePrivacyTest() {
    for (const char* folder : {"", "/parts", "/parts/1", "/mine"}) {
      fs::create_directory(state_ + folder);
      ::chmod((state_ + folder).c_str(), 0755);
    }
    for (const char* file : {"/lock", "/farm.db", "/farm.db-wal", "/parts/1/a", "/parts/1/b",
                             "/mine/file", "/notes"}) {
      std::ofstream(state_ + file) << "x";
      ::chmod((state_ + file).c_str(), 0644);
    }
  }
  ~StatePrivacyTest() override { fs::remove_all(state_); }
  mode_t ModeOf(const std::string& name) const {
    struct stat info {};
    EXPECT_EQ(::stat((state_ + name).c_str(), &info), 0) << name;
    return info.st_mode & 07777;
  }
  const std::string state_ = testing::TemporaryPath("state");
};

TEST_F(StatePrivacyTest, WhatACoordinatorKeepsIsClosedAndNothingElse) {
  fs::create_symlink(state_ + "/notes", state_ + "/parts/link");
  CloseStateDirectory(state_);
  for (const char* folder : {"", "/parts", "/parts/1"}) EXPECT_EQ(ModeOf(folder), 0700u) << folder;
  for (const char* file : {"/lock", "/farm.db", "/farm.db-wal", "/parts/1/a", "/parts/1/b"}) {
    EXPECT_EQ(ModeOf(file), 0600u) << file;
  }
  EXPECT_EQ(ModeOf("/mine"), 0755u);
  EXPECT_EQ(ModeOf("/mine/file"), 0644u);
  EXPECT_EQ(ModeOf("/notes"), 0644u);
}

TEST_F(StatePrivacyTest, AWalkHasALimitAndContinuesAtTheNextStart) {
  CloseStateDirectory(state_, /*entries_max=*/1);
  EXPECT_EQ(ModeOf(""), 0700u) << "which alone keeps others out";
  EXPECT_EQ(ModeOf("/lock"), 0644u);
  CloseStateDirectory(state_);
  EXPECT_EQ(ModeOf("/parts/1/b"), 0600u);
  EXPECT_EQ(ModeOf("/lock"), 0600u);
}

TEST_F(StatePrivacyTest, WhatIsClosedIsNotWalkedAgain) {
  CloseStateDirectory(state_);
  ::chmod((state_ + "/parts/1/a").c_str(), 0640);
  CloseStateDirectory(state_);
  EXPECT_EQ(ModeOf("/parts/1/a"), 0640u);
}

}  // namespace
}  // namespace sheaf::coordinator
