// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/frames/frame_range.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace sheaf::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(FrameRangeTest, ReadsNumbersRangesAndSteps) {
  EXPECT_THAT(*ParseFrameRange("7"), ElementsAre(7));
  EXPECT_THAT(*ParseFrameRange("1-4"), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(*ParseFrameRange("1-10x4"), ElementsAre(1, 5, 9));
  EXPECT_THAT(*ParseFrameRange("1,4,9-12"), ElementsAre(1, 4, 9, 10, 11, 12));
  EXPECT_THAT(*ParseFrameRange("3,1-3,2"), ElementsAre(1, 2, 3));
  EXPECT_THAT(*ParseFrameRange("0-0"), ElementsAre(0));
  EXPECT_THAT(*ParseFrameRange("0001-0003"), ElementsAre(1, 2, 3));
}

TEST(FrameRangeTest, RefusesInvalidRanges) {
  for (const char* text : {"", "a", "1-", "-4", "1--4", "1-4x", "1-4x0", "4-1", "1,,2", "1 -4",
                           "1x5", "99999999999", "1-99999999"}) {
    EXPECT_EQ(ParseFrameRange(text).status().code(), absl::StatusCode::kInvalidArgument) << text;
  }
}

TEST(FrameRangeTest, NamesItsLimits) {
  for (const char* text : {"100000000", "1-99999999999999999999", "5-9x100000000"}) {
    EXPECT_THAT(std::string(ParseFrameRange(text).status().message()),
                HasSubstr("numbers may be at most 99999999"))
        << text;
  }
  EXPECT_THAT(std::string(ParseFrameRange("1-100001").status().message()),
              HasSubstr("more than 100000 frames; submit them as several jobs"));
}

TEST(FrameRangeTest, WritesWhatItReads) {
  for (const char* text : {"7", "1,2", "1-4", "1,4,9-12", "3,5,10-12", "0,1,3-5,8,9"}) {
    EXPECT_EQ(FormatFrameRange(*ParseFrameRange(text)), text);
  }
  EXPECT_EQ(FormatFrameRange({}), "");
}

class FramePathTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = ::testing::TempDir() + "/frame_path_" +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }
  void Make(const std::string& name) {
    const std::filesystem::path path = directory_ + "/" + name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << name;
  }
  // The path of frame 7, below the directory.
  std::string Seventh(const std::string& name, size_t run_min = 1) {
    const absl::StatusOr<FramePath> found = FindFrameNumber(directory_ + "/" + name, 7, run_min);
    if (!found.ok()) return std::string(found.status().message());
    return found->Of(7).substr(directory_.size() + 1);
  }
  std::string SeventhInput(const std::string& name) {
    const absl::StatusOr<FramePath> found = FindInputFrameNumber(directory_ + "/" + name, 7);
    if (!found.ok()) return std::string(found.status().message());
    return found->Of(7).substr(directory_.size() + 1);
  }

  std::string directory_;
};

TEST_F(FramePathTest, TheNumberIsPaddedToTheHashes) {
  EXPECT_EQ(Seventh("shot.####.pbrt"), "shot.0007.pbrt");
  EXPECT_EQ(Seventh("shot.#.pbrt"), "shot.7.pbrt");
  EXPECT_EQ(Seventh("##/shot.##.exr"), "##/shot.07.exr");
  EXPECT_EQ(Seventh("take#2.####.exr"), "take#2.0007.exr");
  EXPECT_EQ(Seventh("take#2.exr", 2), "take#2.exr");
  EXPECT_EQ(Seventh("plain.exr"), "plain.exr");
  EXPECT_EQ(FindFrameNumber("####", 7)->Of(123456), "123456");
  EXPECT_EQ(FindFrameNumber("/#/a", 7)->Of(3), "/3/a");
  EXPECT_FALSE(FindFrameNumber("plain.exr", 7)->HasNumber());
  EXPECT_EQ(LongestRun("####/a#b##.exr"), 2u);
}

TEST_F(FramePathTest, HashesOfFoldersThatExistAreLetters) {
  EXPECT_EQ(Seventh("f/####/s.pbrt"), "f/0007/s.pbrt");
  Make("shot#7/scene.pbrt");
  EXPECT_EQ(Seventh("shot#7/scene.pbrt"), "shot#7/scene.pbrt");
  EXPECT_EQ(Seventh("shot#7/f/####/s.pbrt"), "shot#7/f/0007/s.pbrt");
  Make("g/007/cam#2/s.pbrt");
  EXPECT_EQ(Seventh("g/###/cam#2/s.pbrt"), "g/007/cam#2/s.pbrt");
  EXPECT_THAT(Seventh("none#1/###/s.pbrt"), HasSubstr("# in several folders"));
}

TEST_F(FramePathTest, TheNumberOfAnInputMakesAFile) {
  Make("take#2.0007.pbrt");
  EXPECT_EQ(SeventhInput("take#2.####.pbrt"), "take#2.0007.pbrt");
  Make("0007.take#2.pbrt");
  EXPECT_EQ(SeventhInput("####.take#2.pbrt"), "0007.take#2.pbrt");
  EXPECT_EQ(SeventhInput("none#1.##.pbrt"), "none#1.07.pbrt");
  Make("####.take72.pbrt");
  EXPECT_THAT(SeventhInput("####.take#2.pbrt"), HasSubstr("are both files"));
}

}  // namespace
}  // namespace sheaf::cli
