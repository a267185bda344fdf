// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/dropped/zip_files.h"

#include <archive.h>
#include <archive_entry.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "common/base/file.h"
#include "tests/support/temporary_path.h"

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;

constexpr ZipLimits kLimits{uint64_t{1} << 30, 10};

class ZipFilesTest : public ::testing::Test {
 protected:
  ZipFilesTest() {
    std::filesystem::create_directories(folder_);
    archive_write_set_format_zip(zip_);
    EXPECT_EQ(archive_write_open_filename(zip_, path_.c_str()), ARCHIVE_OK);
  }
  ~ZipFilesTest() override {
    if (zip_ != nullptr) archive_write_free(zip_);
    std::filesystem::remove(path_);
    std::filesystem::remove_all(folder_);
  }
  void Put(const std::string& name, const std::string& bytes, unsigned type = AE_IFREG) {
    archive_entry* entry = archive_entry_new();
    archive_entry_set_pathname(entry, name.c_str());
    archive_entry_set_filetype(entry, type);
    archive_entry_set_perm(entry, 0644);
    archive_entry_set_size(entry, static_cast<int64_t>(bytes.size()));
    if (type == AE_IFLNK) archive_entry_set_symlink(entry, bytes.c_str());
    EXPECT_EQ(archive_write_header(zip_, entry), ARCHIVE_OK);
    if (type == AE_IFREG) archive_write_data(zip_, bytes.data(), bytes.size());
    archive_entry_free(entry);
  }
  absl::Status Unpack(const ZipLimits& limits = kLimits) {
    if (zip_ != nullptr) archive_write_free(zip_);
    zip_ = nullptr;
    return UnpackZip(path_, folder_, limits);
  }
  std::string Read(const std::string& name) {
    return ReadWholeFile(folder_ + "/" + name).value_or("nothing");
  }

  const std::string path_ = sheaf::testing::TemporaryPath("scene.zip");
  const std::string folder_ = sheaf::testing::TemporaryPath("unpacked");
  archive* zip_ = archive_write_new();
};

TEST_F(ZipFilesTest, FilesComeOut) {
  Put("shot/", "", AE_IFDIR);
  Put("shot/scene.pbrt", "WorldBegin");
  Put("shot/textures/wood.png", std::string(300'000, 'w'));
  Put("__MACOSX/shot/._scene.pbrt", "notes");
  Put("shot/.DS_Store", "notes");
  ASSERT_TRUE(Unpack().ok());
  EXPECT_EQ(Read("shot/scene.pbrt"), "WorldBegin");
  EXPECT_EQ(Read("shot/textures/wood.png"), std::string(300'000, 'w'));
  EXPECT_EQ(Read("__MACOSX/shot/._scene.pbrt"), "nothing");
  EXPECT_EQ(Read("shot/.DS_Store"), "nothing");
}

TEST_F(ZipFilesTest, NamesThatLeadOutAreRefused) {
  Put("../outside.pbrt", "x");
  const absl::Status status = Unpack();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("\"..\" is a part of it"));
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/../outside.pbrt"));
}

TEST_F(ZipFilesTest, LinksAreRefused) {
  Put("scene.pbrt", "/etc/passwd", AE_IFLNK);
  const absl::Status status = Unpack();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("is a link or a device"));
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(folder_ + "/scene.pbrt")));
}

TEST_F(ZipFilesTest, ANameOccursOnce) {
  Put("scene.pbrt", "a");
  Put("scene.pbrt", "b");
  EXPECT_THAT(std::string(Unpack().message()), HasSubstr("\"scene.pbrt\" twice"));
}

TEST_F(ZipFilesTest, LimitsOfFilesAndBytesHold) {
  Put("a", "1");
  Put("b", "1");
  Put("c", std::string(1000, 'c'));
  EXPECT_TRUE(absl::IsResourceExhausted(Unpack({1 << 20, 2})));
  std::filesystem::remove_all(folder_);
  std::filesystem::create_directories(folder_);
  EXPECT_TRUE(absl::IsResourceExhausted(Unpack({1000, 10})));
  std::filesystem::remove_all(folder_);
  std::filesystem::create_directories(folder_);
  EXPECT_TRUE(Unpack({1002, 3}).ok());
}

TEST_F(ZipFilesTest, AZipBombIsRefused) {
  Put("zeros", std::string(kZipFreeBytes + (size_t{4} << 20), '\0'));
  const absl::Status status = Unpack();
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("as zip bombs do"));
}

TEST_F(ZipFilesTest, OtherFilesAreRefused) {
  Unpack().IgnoreError();
  ASSERT_TRUE(WriteFileOnce(path_, "this is no zip file, and long enough to be looked at").ok());
  const absl::Status status = Unpack();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("cannot be unpacked"));
}

}  // namespace
}  // namespace sheaf::cli
