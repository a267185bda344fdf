// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/frame_range.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

TEST(FrameRangeTest, PadsFrameNumbersToTheHashes) {
  EXPECT_EQ(ExpandPattern("shot.####.pbrt", 7), "shot.0007.pbrt");
  EXPECT_EQ(ExpandPattern("shot.#.pbrt", 12), "shot.12.pbrt");
  EXPECT_EQ(ExpandPattern("##/shot.##.exr", 3), "##/shot.03.exr");
  EXPECT_EQ(ExpandPattern("####", 123456), "123456");
  EXPECT_EQ(ExpandPattern("plain.exr", 7), "plain.exr");
}

TEST(FrameRangeTest, RecognizesPatternsByFileName) {
  EXPECT_TRUE(IsPattern("a/shot.##.pbrt"));
  EXPECT_FALSE(IsPattern("#1/shot.pbrt"));
  EXPECT_FALSE(IsPattern("shot.pbrt"));
}

}  // namespace
}  // namespace sheaf::cli
