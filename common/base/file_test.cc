// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

namespace sheaf {
namespace {

class FileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = ::testing::TempDir() + "sheaf-file-XXXXXX";
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    directory_ = pattern;
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  size_t CountEntries() const {
    size_t count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(directory_))
      count += !entry.path().empty();
    return count;
  }

  std::string directory_;
};

TEST_F(FileTest, WritesReadsAndReplaces) {
  const std::string path = directory_ + "/a file";
  const std::string bytes("with\0zero and \xff", 15);
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
  EXPECT_EQ(*ReadWholeFile(path), bytes);
  ASSERT_TRUE(WriteFileAtomically(path, "").ok());
  EXPECT_EQ(*ReadWholeFile(path), "");
  EXPECT_EQ(CountEntries(), 1u) << "a temporary file was left";
}

TEST_F(FileTest, OnlyTheOwnerReadsSecrets) {
  const std::string folder = directory_ + "/secrets", path = folder + "/key";
  ASSERT_TRUE(MakeDirectories(folder).ok());
  ASSERT_TRUE(MakePrivateDirectory(folder).ok());
  ASSERT_TRUE(WriteSecretAtomically(path, "secret").ok());
  struct stat info {};
  ASSERT_EQ(::stat(path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  ASSERT_EQ(::stat(folder.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0700u);
}

TEST_F(FileTest, TheUmaskDecidesWhoMayWriteOthers) {
  const mode_t before = ::umask(0);
  for (const mode_t mask : {0002, 0022, 0077}) {
    ::umask(mask);
    const std::string path = directory_ + "/file";
    const auto mode = [&](const absl::Status& written) {
      struct stat info {};
      EXPECT_TRUE(written.ok() && ::stat(path.c_str(), &info) == 0);
      ::unlink(path.c_str());
      return info.st_mode & 0777;
    };
    EXPECT_EQ(mode(WriteFileAtomically(path, "x")), 0666 & ~mask);
    EXPECT_EQ(mode(WriteFileUnsynced(path, "x")), 0600);
    EXPECT_EQ(mode(WriteFileOnce(path, "x")), 0600);
    EXPECT_EQ(mode(WriteSecretAtomically(path, "x")), 0600);
    EXPECT_TRUE(MakeDirectories(directory_ + "/above/folder").ok());
    for (const char* folder : {"/above", "/above/folder"}) {
      struct stat info {};
      EXPECT_EQ(::stat((directory_ + folder).c_str(), &info), 0);
      EXPECT_EQ(info.st_mode & 0777, 0700u) << folder;
    }
    std::filesystem::remove_all(directory_ + "/above");
  }
  ::umask(before);
}

TEST_F(FileTest, SymbolicLinksAreFollowedAndKept) {
  const std::string file = directory_ + "/real", link = directory_ + "/link";
  std::filesystem::create_symlink("real", link);
  std::filesystem::create_symlink(link, directory_ + "/second");
  ASSERT_TRUE(WriteFileAtomically(link, "to where nothing was").ok());
  EXPECT_EQ(*ReadWholeFile(file), "to where nothing was");
  ASSERT_TRUE(WriteFileAtomically(directory_ + "/second", "by two links").ok());
  EXPECT_EQ(*ReadWholeFile(file), "by two links");
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_EQ(CountEntries(), 3u);
  std::filesystem::create_symlink("circle", directory_ + "/circle");
  EXPECT_EQ(WriteFileAtomically(directory_ + "/circle", "").code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST_F(FileTest, ReplacesOnlyRegularFiles) {
  const std::string pipe = directory_ + "/pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::filesystem::create_symlink("pipe", directory_ + "/link");
  for (const std::string& path : {pipe, directory_ + "/link", directory_}) {
    EXPECT_EQ(WriteFileAtomically(path, "x").code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_EQ(CheckWritable(path).code(), absl::StatusCode::kFailedPrecondition);
  }
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
}

TEST_F(FileTest, UnwritablePathsAreDetectedBeforeWriting) {
  EXPECT_TRUE(absl::IsNotFound(CheckWritable(directory_ + "/none/a.exr")));
  EXPECT_TRUE(CheckWritable(directory_ + "/a.exr").ok());
  EXPECT_EQ(CountEntries(), 0u) << "the probe was left";
}

TEST_F(FileTest, NamesMayBeAsLongAsTheFileSystemTakes) {
  for (const size_t bytes : {240, 244, 254, 255}) {
    const std::string path = directory_ + "/" + std::string(bytes - 4, 'n') + ".exr";
    EXPECT_TRUE(CheckWritable(path).ok()) << CheckWritable(path);
    ASSERT_TRUE(WriteFileAtomically(path, "x").ok()) << bytes;
    EXPECT_EQ(*ReadWholeFile(path), "x");
  }
  const absl::Status status = CheckWritable(directory_ + "/" + std::string(256, 'n'));
  EXPECT_EQ(status.message().find("folder"), std::string::npos) << status;
  EXPECT_NE(status.message().find("File name too long"), std::string::npos) << status;
  EXPECT_EQ(CountEntries(), 4u);
}

TEST_F(FileTest, WritesRelativePaths) {
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(directory_);
  const absl::Status status = WriteFileAtomically("bare-name", "x");
  std::filesystem::current_path(before);
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(*ReadWholeFile(directory_ + "/bare-name"), "x");
}

TEST_F(FileTest, FailedWriteNamesThePathAndLeavesNoFile) {
  const absl::Status status = WriteFileAtomically(directory_ + "/none/file", "x");
  EXPECT_TRUE(absl::IsNotFound(status));
  EXPECT_NE(std::string(status.message()).find(directory_ + "/none/file"), std::string::npos);
  // A directory has the name: the rename fails after the bytes are written.
  ASSERT_TRUE(MakeDirectories(directory_ + "/taken/inside").ok());
  EXPECT_FALSE(WriteFileAtomically(directory_ + "/taken", "x").ok());
  EXPECT_EQ(CountEntries(), 1u);
}

TEST_F(FileTest, ReadersSeeACompleteVersion) {
  const std::string path = directory_ + "/file";
  constexpr size_t kSize = 1 << 16;
  ASSERT_TRUE(WriteFileAtomically(path, std::string(kSize, '0')).ok());
  std::vector<std::thread> writers;
  for (const char c : {'1', '2'}) {
    writers.emplace_back([&path, c] {
      for (int i = 0; i < 10; ++i)
        EXPECT_TRUE(WriteFileAtomically(path, std::string(kSize, c)).ok());
    });
  }
  for (int i = 0; i < 50; ++i) {
    const absl::StatusOr<std::string> bytes = ReadWholeFile(path);
    ASSERT_TRUE(bytes.ok());
    EXPECT_EQ(*bytes, std::string(kSize, bytes->front()));
  }
  for (std::thread& writer : writers) writer.join();
}

TEST_F(FileTest, ReadingHasALimitAndReportsErrors) {
  const std::string path = directory_ + "/file";
  ASSERT_TRUE(WriteFileAtomically(path, "12345678").ok());
  EXPECT_TRUE(ReadWholeFile(path, 8).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(ReadWholeFile(path, 7).status()));
  EXPECT_TRUE(absl::IsNotFound(ReadWholeFile(directory_ + "/none").status()));
  EXPECT_TRUE(absl::IsInvalidArgument(ReadWholeFile(directory_).status()));
  // Reading an endless device stops at the limit.
  EXPECT_TRUE(absl::IsResourceExhausted(ReadWholeFile("/dev/zero", 1 << 20).status()));
}

TEST_F(FileTest, MakingDirectoriesIsIdempotent) {
  const std::string path = directory_ + "/a/b/c";
  EXPECT_TRUE(MakeDirectories(path).ok());
  EXPECT_TRUE(MakeDirectories(path).ok());
  EXPECT_TRUE(std::filesystem::is_directory(path));
  ASSERT_TRUE(WriteFileAtomically(directory_ + "/file", "").ok());
  const absl::Status status = MakeDirectories(directory_ + "/file/under");
  EXPECT_FALSE(status.ok());
  EXPECT_NE(std::string(status.message()).find("/file/under"), std::string::npos);
}

}  // namespace
}  // namespace sheaf
