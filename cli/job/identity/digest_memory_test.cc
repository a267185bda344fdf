// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A file that has not changed keeps its digest from one command to the next; any change, or a
// change that a time stamp could hide, makes it be hashed again.
#include "cli/job/identity/digest_memory.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "cli/job/identity/file_digests.h"
#include "common/base/digest.h"

namespace sheaf::cli {
namespace {

constexpr int64_t kNow = 1'000'000'000'000;

class DigestMemoryTest : public ::testing::Test {
 protected:
  ~DigestMemoryTest() override { std::filesystem::remove(file_); }
  std::string file_ = ::testing::TempDir() + "/digest_memory_" +
                      ::testing::UnitTest::GetInstance()->current_test_info()->name();
  FileState state_{1, 2, kRememberedBytesMin, kNow - kSettledNanoseconds,
                   kNow - kSettledNanoseconds};
  BlobDigest digest_{Sha256Hex("x"), kRememberedBytesMin};
};

TEST_F(DigestMemoryTest, KeepsADigestFromOneCommandToTheNext) {
  {
    DigestMemory memory(file_);
    memory.Remember("/a file", state_, digest_, kNow);
    memory.Save();
  }
  const DigestMemory memory(file_);
  EXPECT_EQ(memory.Find("/a file", state_), digest_);
  EXPECT_EQ(memory.Find("/another", state_), std::nullopt);
  for (const auto change : {&FileState::modified_ns, &FileState::changed_ns}) {
    FileState other = state_;
    ++(other.*change);
    EXPECT_EQ(memory.Find("/a file", other), std::nullopt);
  }
}

TEST_F(DigestMemoryTest, ForgetsWhatCouldBeWrong) {
  DigestMemory memory(file_);
  memory.Remember("/fresh", state_, digest_, kNow - 1);
  EXPECT_EQ(memory.Find("/fresh", state_), std::nullopt);
  memory.Remember("/line\nbreak", state_, digest_, kNow);
  memory.Remember("/short", state_, {digest_.sha256_hex, 5}, kNow);
  EXPECT_EQ(memory.Find("/short", state_), std::nullopt);
  memory.Save();
  EXPECT_FALSE(std::filesystem::exists(file_)) << "there was nothing to save";
  std::ofstream(file_) << "sheaf digests 1\nnonsense\n" << digest_.sha256_hex << " 1 2 3\n";
  EXPECT_EQ(DigestMemory(file_).Find("/short", state_), std::nullopt);
}

TEST_F(DigestMemoryTest, AFileOfADayAgoIsHashedOnce) {
  const std::string path = file_ + ".bin";
  std::ofstream(path) << std::string(kRememberedBytesMin, 'a');
  DigestMemory memory(file_);
  {
    FileDigests digests(&memory);
    ASSERT_TRUE(digests.Of(path).ok());
  }
  // It is too new to be remembered.
  EXPECT_EQ(memory.Find(path, *StateOfFile(path)), std::nullopt);
  // A remembered digest is used without reading the file.
  const FileState state = *StateOfFile(path);
  memory.Remember(path, state, digest_, state.changed_ns + kSettledNanoseconds);
  EXPECT_EQ(*FileDigests(&memory).Of(path), digest_);
  std::ofstream(path, std::ios::app) << "b";
  EXPECT_NE(*FileDigests(&memory).Of(path), digest_);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace sheaf::cli
