// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/tar_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "common/base/file.h"
#include "tests/support/temporary_path.h"

namespace sheaf {
namespace {

using sheaf::testing::TemporaryPath;

constexpr size_t kEntriesMax = 3;

ReadBytesAt InMemory(const std::string& bytes) {
  return [&bytes](uint64_t offset, uint64_t size) -> absl::StatusOr<std::string> {
    EXPECT_LE(offset + size, bytes.size());
    return bytes.substr(offset, size);
  };
}

absl::StatusOr<std::vector<TarEntry>> List(const std::string& bytes) {
  return ListTar(InMemory(bytes), bytes.size(), kEntriesMax);
}

class TarFileTest : public ::testing::Test {
 protected:
  ~TarFileTest() override { std::filesystem::remove(path_); }
  // The bytes of a tar file with three files: of one block and a bit, of none, and of a whole one.
  std::string Write() {
    auto writer = *TarWriter::Create(path_);
    EXPECT_TRUE(writer->Begin("first", 600).ok());
    EXPECT_TRUE(writer->Append(std::string(500, 'a')).ok());
    EXPECT_EQ(writer->bytes_left(), 100u);
    EXPECT_TRUE(writer->Append(std::string(100, 'b')).ok());
    EXPECT_TRUE(writer->Begin("files/none", 0).ok());
    EXPECT_TRUE(writer->Begin("last", 512).ok());
    EXPECT_TRUE(absl::IsInvalidArgument(writer->Append(std::string(513, 'c'))));
    EXPECT_TRUE(writer->Append(std::string(512, 'c')).ok());
    EXPECT_TRUE(writer->Finish().ok());
    return *ReadWholeFile(path_);
  }
  const std::string path_ = TemporaryPath("files.tar");
};

TEST_F(TarFileTest, FilesComeBack) {
  const std::string bytes = Write();
  const auto entries = List(bytes);
  ASSERT_TRUE(entries.ok()) << entries.status();
  ASSERT_EQ(entries->size(), 3u);
  EXPECT_EQ((*entries)[0].name, "first");
  EXPECT_EQ(bytes.substr((*entries)[0].offset_bytes, 600),
            std::string(500, 'a') + std::string(100, 'b'));
  EXPECT_EQ((*entries)[1].size_bytes, 0u);
  EXPECT_EQ(bytes.substr((*entries)[2].offset_bytes, 512), std::string(512, 'c'));
  uint64_t size = 0;
  const auto read = OpenForReading(path_, &size);
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(size, bytes.size());
  EXPECT_EQ(*(*read)(512, 1), "a");
  EXPECT_TRUE(absl::IsDataLoss((*read)(size - 1, 2).status()));
}

TEST_F(TarFileTest, TarExtractsIt) {
  Write();
  const std::string folder = TemporaryPath("extracted");
  std::filesystem::create_directory(folder);
  ASSERT_EQ(std::system(("tar -xf '" + path_ + "' -C '" + folder + "'").c_str()), 0);
  EXPECT_EQ(*ReadWholeFile(folder + "/last"), std::string(512, 'c'));
  EXPECT_EQ(*ReadWholeFile(folder + "/files/none"), "");
  std::filesystem::remove_all(folder);
}

TEST_F(TarFileTest, AnyByteOutsideOfContentThatChangedIsRefused) {
  const std::string bytes = Write();
  const std::vector<TarEntry> entries = *List(bytes);
  const auto is_content = [&](size_t at) {
    return std::ranges::any_of(entries, [at](const TarEntry& entry) {
      return at >= entry.offset_bytes && at < entry.offset_bytes + entry.size_bytes;
    });
  };
  for (size_t at = 0; at < bytes.size(); ++at) {
    if (is_content(at)) continue;
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 4);
    EXPECT_TRUE(absl::IsDataLoss(List(changed).status())) << at;
  }
}

TEST_F(TarFileTest, AFileThatIsCutShortOrTooLongIsRefused) {
  const std::string bytes = Write();
  for (size_t size = 0; size < bytes.size(); size += 100) {
    EXPECT_TRUE(absl::IsDataLoss(List(bytes.substr(0, size)).status())) << size;
  }
  EXPECT_TRUE(absl::IsDataLoss(List(bytes + std::string(512, '\0')).status()));
}

TEST_F(TarFileTest, LimitsHold) {
  const std::string bytes = Write();
  EXPECT_TRUE(absl::IsResourceExhausted(ListTar(InMemory(bytes), bytes.size(), 2).status()));
  auto writer = *TarWriter::Create(path_);
  EXPECT_TRUE(absl::IsInvalidArgument(writer->Begin("huge", kTarFileBytesMax + 1)));
}

}  // namespace
}  // namespace sheaf
