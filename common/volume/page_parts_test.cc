// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Page files in parts give the values of whole ones, and parts are opened when they are read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "common/base/file.h"
#include "common/volume/page_maker.h"
#include "common/volume/volume_file.h"
#include "common/volume/volume_pages.h"
#include "tests/support/temporary_path.h"
#include "tests/support/volume/volume_files.h"

namespace sheaf {
namespace {

using ::sheaf::testing::GridToWrite;
using ::sheaf::testing::NvdbCodec;
using ::sheaf::testing::NvdbFile;
using ::sheaf::testing::TemporaryPath;
using ::sheaf::testing::Voxel;
using ::testing::HasSubstr;
using volume::VolumePages;

// A page file in parts, in a folder of its own.
// Values that do not compress, for several parts.
float Noise(const Voxel& v) {
  uint32_t h = 0;
  for (const int32_t at : v) h = (h ^ static_cast<uint32_t>(at + 1'000)) * 0x9e3779b1u;
  h ^= h >> 15;
  return static_cast<float>((h * 0x85ebca6bu) >> 8) * 0x1p-24f + 0.5f;
}

class PagePartsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const GridToWrite cloud{.lo = {-60, -20, 3}, .hi = {70, 80, 90}, .value = Noise};
    ASSERT_TRUE(WriteFileAtomically(volume_path_, NvdbFile({cloud}, NvdbCodec::kNone)).ok());
    const auto made = MakePageFile("smoke.vdb", volume_path_, page_path_);
    ASSERT_TRUE(made.ok()) << made.status();
    std::filesystem::create_directory(folder_);
    const auto parts = SplitPageFile("smoke.pages", page_path_, folder_);
    ASSERT_TRUE(parts.ok()) << parts.status();
    parts_ = *parts;
    ASSERT_GT(parts_.part_paths.size(), 2u);
  }
  ~PagePartsTest() override {
    std::filesystem::remove_all(folder_);
    ::unlink(volume_path_.c_str());
    ::unlink(page_path_.c_str());
  }
  volume::PartedBytes::OpenPart Opener() {
    return [this](size_t part) -> absl::StatusOr<volume::FileBytes> {
      ++opened_;
      return volume::FileBytes::Open("a part", parts_.part_paths[part]);
    };
  }
  absl::StatusOr<VolumeGrid> ReadParts(std::shared_ptr<VolumePages> pages,
                                       volume::PartedBytes::OpenPart open_part) {
    return ReadVolumeGrid("smoke.vdb", parts_.index_path, "density", {}, 1, std::move(pages),
                          std::move(open_part));
  }
  const std::string folder_ = TemporaryPath("parts");
  const std::string volume_path_ = TemporaryPath("volume"), page_path_ = TemporaryPath("pages");
  PageParts parts_;
  std::atomic<int> opened_{0};
};

TEST_F(PagePartsTest, LookupsHaveTheBitsOfTheWholeFile) {
  const auto pages = std::make_shared<VolumePages>(uint64_t{64} << 10);
  const auto whole = ReadVolumeGrid("smoke.pages", page_path_, "density");
  const auto parted = ReadParts(pages, Opener());
  ASSERT_TRUE(whole.ok() && parted.ok()) << parted.status();
  EXPECT_EQ(opened_, 0);  // The index is enough so far.
  EXPECT_EQ(PagePartCount(parts_.index_path), parts_.part_paths.size());
  EXPECT_EQ(PageIndexBytes(parts_.index_path), PageIndexBytes(page_path_));
  EXPECT_EQ(ListVolumeFile("smoke.vdb", parts_.index_path)->size(), 1u);
  VolumeGrid::Cursor at_whole(*whole), at_parted(*parted);
  for (int i = 0; i < 20'000; ++i) {
    // Points in no order.
    const Vec3d p{i * 37 % 140 - 65 + 0.25, i * 53 % 110 - 25 + 0.5, i * 71 % 95 + 0.75};
    ASSERT_EQ(parted->At(p, &at_parted), whole->At(p, &at_whole));
  }
  EXPECT_TRUE(pages->status().ok()) << pages->status();
  EXPECT_GT(pages->counts().pages_read, 50u);
  EXPECT_EQ(opened_, static_cast<int>(parts_.part_paths.size()));  // Each once.
}

TEST_F(PagePartsTest, PartsAreThePagesOfTheFile) {
  std::string joined;
  for (const std::string& path : parts_.part_paths) joined += *ReadWholeFile(path, 1 << 30);
  const std::string whole = *ReadWholeFile(page_path_, 1 << 30);
  EXPECT_EQ(joined, whole.substr(0, joined.size()));
  EXPECT_LT(whole.size() - joined.size(), *PageIndexBytes(page_path_) + 200);
}

TEST_F(PagePartsTest, APartThatDoesNotComeIsAnError) {
  const auto pages = std::make_shared<VolumePages>(uint64_t{64} << 10);
  const auto parted = ReadParts(pages, [](size_t) -> absl::StatusOr<volume::FileBytes> {
    return absl::UnavailableError("the coordinator is away");
  });
  ASSERT_TRUE(parted.ok()) << parted.status();
  VolumeGrid::Cursor cursor(*parted);
  EXPECT_EQ(parted->At({0, 10, 20}, &cursor), 0);
  EXPECT_TRUE(absl::IsUnavailable(pages->status())) << pages->status();
  EXPECT_THAT(pages->status().message(), HasSubstr("the coordinator is away"));
}

TEST_F(PagePartsTest, AlteredAndShortPartsAreFound) {
  const std::string good = *ReadWholeFile(parts_.part_paths[0], 1 << 30);
  std::string altered = good;
  for (size_t i = 100; i < altered.size(); i += 100) altered[i] = static_cast<char>(~altered[i]);
  for (const std::string& bytes : {altered, good.substr(0, good.size() - 1)}) {
    ASSERT_TRUE(WriteFileAtomically(parts_.part_paths[0], bytes).ok());
    const auto pages = std::make_shared<VolumePages>(uint64_t{64} << 10);
    const auto parted = ReadParts(pages, Opener());
    ASSERT_TRUE(parted.ok()) << parted.status();
    VolumeGrid::Cursor cursor(*parted);
    for (int i = 0; i < 100; ++i) parted->At({i - 62.0, 10, 20}, &cursor);
    EXPECT_FALSE(pages->status().ok());
  }
}

TEST_F(PagePartsTest, ADamagedIndexIsRefused) {
  const std::string good = *ReadWholeFile(parts_.index_path, 1 << 30);
  std::string many = good, large = good;
  many[8] = many[9] = '\x7f';
  std::memset(large.data() + 16, 0x7f, 8);
  for (const std::string& bytes : {many, large, good.substr(0, 20)}) {
    ASSERT_TRUE(WriteFileAtomically(parts_.index_path, bytes).ok());
    const auto pages = std::make_shared<VolumePages>(uint64_t{64} << 10);
    const auto parted = ReadParts(pages, Opener());
    // A part that is said to be larger is found when it is read.
    if (parted.ok()) {
      VolumeGrid::Cursor cursor(*parted);
      EXPECT_EQ(parted->At({0, 10, 20}, &cursor), 0);
      EXPECT_FALSE(pages->status().ok());
    } else {
      EXPECT_TRUE(absl::IsInvalidArgument(parted.status())) << parted.status();
    }
  }
}

}  // namespace
}  // namespace sheaf
