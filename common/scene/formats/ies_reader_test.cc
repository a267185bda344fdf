// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/ies_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

namespace sheaf {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

absl::StatusOr<CandelaTable> Read(const std::string& text) {
  const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::string path = ::testing::TempDir() + "sheaf-ies-" + info->name() + ".ies";
  std::ofstream(path, std::ios::binary) << text;
  return ReadIes("lamps/a.ies", path);
}
CandelaTable ReadGood(const std::string& text) {
  absl::StatusOr<CandelaTable> table = Read(text);
  EXPECT_TRUE(table.ok()) << table.status();
  return table.ok() ? *std::move(table) : CandelaTable{};
}

TEST(IesReaderTest, ReadsEveryVersion) {
  // One lamp, multiplier 2, ballast 0.5, ballast-lamp factor 3, which lost its meaning in 2002.
  const std::string numbers =
      "1 1000 2 3 1 1 2 0 0 0\r\n0.5 3 60\r\n0 45 90\r\n0\r\n100 50, 1.5e1\r\n";
  const struct {
    const char* head;
    float factor;
  } versions[] = {
      {"some luminaire\r\nTILT=NONE\r\n", 3},  // 1986: no keywords.
      {"IESNA91\r\n[TEST] 7\r\nTILT=NONE\r\n", 3},
      {"IESNA:LM-63-1995\r\n[MORE] a TILT= in a remark\r\n  TILT=NONE\r\n", 3},
      {"IESNA:LM-63-2002\r\nTILT=NONE\r\n", 1},
      {"IES:LM-63-2019\nTILT=NONE\n", 1},
      {"IESNA:LM-63-1995\r\nTILT=other.tlt\r\n", 3},
      {"IESNA:LM-63-1995\r\nTILT=INCLUDE\r\n1\r\n3\r\n0 90 180\r\n1 .9 .8\r\n", 3},
  };
  for (const auto& version : versions) {
    SCOPED_TRACE(version.head);
    const CandelaTable table = ReadGood(version.head + numbers);
    EXPECT_THAT(table.vertical_degrees, ElementsAre(0, 45, 90));
    EXPECT_THAT(table.horizontal_degrees, ElementsAre(0));
    EXPECT_EQ(table.dims_when_tilted,
              std::string(version.head).find("TILT=NONE") == std::string::npos);
    EXPECT_THAT(table.candelas,
                ElementsAre(100 * version.factor, 50 * version.factor, 15 * version.factor));
  }
}

TEST(IesReaderTest, SymmetricTablesUnfoldToTheFullCircle) {
  const auto planes = [](const std::string& angles, int count) {
    std::string text =
        "TILT=NONE\n1 1 1 2 " + std::to_string(count) + " 1 2 0 0 0 1 1 1 0 180 " + angles;
    for (int i = 0; i < count; ++i) text += " " + std::to_string(i) + " 9";
    const CandelaTable table = ReadGood(text);
    std::vector<std::pair<float, float>> found;  // Angle, candela straight down.
    for (size_t i = 0; i < table.horizontal_degrees.size(); ++i) {
      EXPECT_EQ(table.candelas.at(2 * i + 1), 9);
      found.emplace_back(table.horizontal_degrees[i], table.candelas[2 * i]);
    }
    return found;
  };
  using P = std::pair<float, float>;
  EXPECT_THAT(planes("0 30 90", 3), ElementsAre(P{0, 0}, P{30, 1}, P{90, 2}, P{150, 1}, P{180, 0},
                                                P{210, 1}, P{270, 2}, P{330, 1}));
  EXPECT_THAT(planes("0 10 180", 3), ElementsAre(P{0, 0}, P{10, 1}, P{180, 2}, P{350, 1}));
  EXPECT_THAT(planes("90 100 270", 3), ElementsAre(P{80, 1}, P{90, 0}, P{100, 1}, P{270, 2}));
  EXPECT_THAT(planes("0 100 200 360", 4), ElementsAre(P{0, 0}, P{100, 1}, P{200, 2}));
  EXPECT_THAT(planes("0 120 240", 3), ElementsAre(P{0, 0}, P{120, 1}, P{240, 2}));
  EXPECT_THAT(planes("22.5", 1), ElementsAre(P{22.5f, 0}));
}

TEST(IesReaderTest, ErrorsNameTheirLocation) {
  const struct {
    const char* text;
    const char* expected;
  } mistakes[] = {
      {"", "a.ies:1:1: there is no line TILT=NONE; is it an IES (LM-63) file?"},
      {"IESNA91\n[TEST]\n1 2 3\n", "there is no line TILT=NONE"},
      {"TILT=NONE\n1 1000 1",
       "lamps/a.ies:2:9: the file ends where the number of vertical angles "
       "should be"},
      {"TILT=NONE\n1 bright",
       "lamps/a.ies:2:3: expected the lumens of a lamp, a number, not "
       "\"bright\""},
      {"TILT=NONE\n1 1 1 1 1 1",
       "lamps/a.ies:2:7: the number of vertical angles is 1, but must be "
       "a whole number from 2 to 1048576"},
      {"TILT=NONE\n1 1 1 2.5 1 1", "the number of vertical angles is 2.5"},
      {"TILT=NONE\n1 1 1 1000 1e9 1",
       "the number of horizontal angles is 1e+09, but must be a whole "
       "number from 1 to 1048"},
      {"TILT=INCLUDE\n1\n-1\n", "lamps/a.ies:3:1: the number of tilt angles is -1"},
      {"TILT=NONE\n1 1 1 2 1 2",
       "lamps/a.ies:2:11: photometry of types A and B is not supported; Sheaf supports type C, "
       "which is 1"},
      {"TILT=NONE\n1 1 1 2 1 1 2 0 0 0\n1 1 1\n0 181",
       "lamps/a.ies:4:3: a vertical angle is 181, "
       "outside of [0, 180] degrees"},
      {"TILT=NONE\n1 1 1 2 1 1 2 0 0 0\n1 1 1\n9 9",
       "a vertical angle is 9 after 9, but angles must "
       "increase"},
      {"TILT=NONE\n1 1 1 2 2 1 2 0 0 0\n1 1 1\n0 9\n0 45 1 1 1 1",
       "horizontal angles go from 0 to 45 degrees; LM-63 has 0, 0 to 90, 0 to 180"},
      {"TILT=NONE\n1 1 1 2 1 1 2 0 0 0\n1 1 1\n0 9\n0\n1 -2",
       "lamps/a.ies:6:3: a candela value is -2 "
       "with its multipliers"},
      {"TILT=NONE\n1 1 1e38 2 1 1 2 0 0 0\n1 1 1\n0 9\n0\n1 1e9", "a candela value is inf"},
      {"TILT=NONE\n1 1 1 2 1 1 2 0 0 0\n1 1 1\n0 9\n0\n1",
       "the file ends where a candela should be"},
  };
  for (const auto& mistake : mistakes) {
    const absl::StatusOr<CandelaTable> table = Read(mistake.text);
    ASSERT_FALSE(table.ok()) << mistake.text;
    EXPECT_EQ(table.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(table.status().message()), HasSubstr(mistake.expected));
  }
  EXPECT_EQ(ReadIes("a.ies", ::testing::TempDir() + "gone.ies").status().code(),
            absl::StatusCode::kNotFound);
}

// The counts in a header allocate no memory before the numbers are there.
TEST(IesReaderTest, LargeFilesAreRefused) {
  EXPECT_EQ(Read("TILT=NONE\n" + std::string(1 << 24, ' ')).status().code(),
            absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace sheaf
