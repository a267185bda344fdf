// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/formats/lens_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "tests/support/temporary_path.h"

namespace sheaf {
namespace {

absl::StatusOr<std::vector<LensSurface>> ReadLensText(const std::string& text) {
  const std::string path = testing::TemporaryPath("lens.dat");
  std::ofstream(path, std::ios::binary) << text;
  return ReadLens("lens.dat", path);
}

TEST(LensReaderTest, FourNumbersMakeASurface) {
  const auto lens = ReadLensText(
      "# radius thickness index diameter\r\n"
      "  58.950\t7.520 1.670 50.4 # the front\n"
      "0 9 0 34.2 -79.46\n72.228, 1 40");
  ASSERT_TRUE(lens.ok()) << lens.status();
  ASSERT_EQ(lens->size(), 3u);
  EXPECT_EQ((*lens)[0].curvature_radius_mm, 58.95);
  EXPECT_EQ((*lens)[0].thickness_mm, 7.52);
  EXPECT_EQ((*lens)[0].eta, 1.67);
  EXPECT_EQ((*lens)[0].aperture_diameter_mm, 50.4);
  EXPECT_EQ((*lens)[1].eta, 1);  // 0 is air.
  EXPECT_EQ((*lens)[2].curvature_radius_mm, -79.46);
  EXPECT_EQ((*lens)[2].thickness_mm, 72.228);
}

TEST(LensReaderTest, StopsAreFlatInAir) {
  LensDescription lens;
  lens.surfaces = *ReadLensText("50 4 1.5 20  0 5 1 20  0 45 0 10");
  EXPECT_FALSE(IsStop(lens, 0));
  EXPECT_FALSE(IsStop(lens, 1));  // The flat back of the lens.
  EXPECT_TRUE(IsStop(lens, 2));
}

TEST(LensReaderTest, ErrorsNameTheirLocation) {
  const std::pair<const char*, const char*> kCases[] = {
      {"", "lens.dat:1:1: the file has no surfaces"},
      {"# nothing\n", "lens.dat:1:1: the file has no surfaces"},
      {"50 4 1.5 20\n-50 45 1\n", "lens.dat:2:8: the file ends within a surface: 7 numbers"},
      {"50 4 glass 20", "lens.dat:1:6: expected a number, not \"glass\""},
      {"50 4 nan 20", "lens.dat:1:6: expected a number"},
      {"1e12 4 1.5 20", "lens.dat:1:1: 1e+12: a radius of curvature this large is flat: give 0"},
      {"1e-12 4 1.5 20", "lens.dat:1:1: 1e-12: the radius is too small"},
      {"50 -4 1.5 20", "lens.dat:1:4: -4: a thickness is at least 0"},
      {"50 4 11 20", "lens.dat:1:6: 11: an index of refraction is within [0.1, 10]"},
      {"50 4 1.5 0", "lens.dat:1:10: 0: an aperture's diameter is greater than 0"},
      {"50 4 1.5 20", "lens.dat:1:6: the film lies in air: the last index must be 1"},
  };
  for (const auto& [text, message] : kCases) {
    const auto lens = ReadLensText(text);
    ASSERT_FALSE(lens.ok()) << text;
    EXPECT_THAT(std::string(lens.status().message()), ::testing::HasSubstr(message)) << text;
  }
  EXPECT_FALSE(ReadLens("none", testing::TemporaryPath("none.dat")).ok());
}

TEST(LensReaderTest, LargeFilesAreRefused) {
  std::string text;
  for (size_t i = 0; i <= kLensSurfacesMax; ++i) text += "50 4 1 20\n";
  EXPECT_EQ(ReadLensText(text).status().code(), absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace sheaf
