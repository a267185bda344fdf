// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/image_color.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/film/error/compare.h"
#include "common/film/error/error_estimate.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/film.h"
#include "common/film/film_test_samples.h"

namespace sheaf {
namespace {

Vec3d Column(const Matrix4& m, size_t i) { return {m.m[0][i], m.m[1][i], m.m[2][i]}; }

void ExpectMatrix(const Matrix4& m, const double (&rows)[3][3], double allowed) {
  for (size_t r = 0; r < 3; ++r) {
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(m.m[r][c], rows[r][c], allowed) << r << " " << c;
  }
}

ImageColor ColorOf(Primaries primaries) {
  ImageColor color;
  color.chromaticities = ChromaticitiesOf(primaries);
  color.light_from_srgb = color.albedo_from_srgb =
      *RgbFromRgb(color.chromaticities, Chromaticities());
  return color;
}

// The matrices printed in SMPTE ST 2065-1:2012, Academy S-2014-004 and IEC 61966-2-1.
TEST(ImageColorTest, MatricesMatchTheStandards) {
  ExpectMatrix(*XyzFromRgb(ChromaticitiesOf(Primaries::kAces2065)),
               {{0.9525523959, 0, 0.0000936786},
                {0.3439664498, 0.7281660966, -0.0721325464},
                {0, 0, 1.0088251844}},
               1e-9);
  ExpectMatrix(*XyzFromRgb(ChromaticitiesOf(Primaries::kAcesCg)),
               {{0.6624541811, 0.1340042065, 0.1561876870},
                {0.2722287168, 0.6740817658, 0.0536895174},
                {-0.0055746495, 0.0040607335, 1.0103391003}},
               1e-9);
  ExpectMatrix(*XyzFromRgb(Chromaticities()),
               {{0.4124, 0.3576, 0.1805}, {0.2126, 0.7152, 0.0722}, {0.0193, 0.1192, 0.9505}},
               6e-5);
  // AP1 from AP0, S-2014-004.
  ExpectMatrix(
      *RgbFromRgb(ChromaticitiesOf(Primaries::kAcesCg), ChromaticitiesOf(Primaries::kAces2065)),
      {{1.4514393161, -0.2365107469, -0.2149285693},
       {-0.0765537734, 1.1762296998, -0.0996759264},
       {0.0083161484, -0.0060324498, 0.9977163014}},
      1e-9);
}

TEST(ImageColorTest, EqualWhitePointsNeedNoAdaptation) {
  for (const Primaries wide : {Primaries::kRec2020, Primaries::kDciP3}) {
    const Matrix4 m = *RgbFromRgb(ChromaticitiesOf(wide), Chromaticities());
    const Vec3d white = Column(m, 0) + Column(m, 1) + Column(m, 2);
    for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(white[i], 1, 1e-12);
  }
  EXPECT_EQ(*RgbFromRgb(Chromaticities(), Chromaticities()), Matrix4());
}

TEST(ImageColorTest, DegeneratePrimariesHaveNoConversion) {
  Chromaticities line;
  line.blue = {0.5 * (line.red.x + line.green.x), 0.5 * (line.red.y + line.green.y)};
  EXPECT_FALSE(XyzFromRgb(line).has_value());
  Chromaticities black;
  black.white.y = 0;
  EXPECT_FALSE(RgbFromRgb(black, Chromaticities()).has_value());
  Chromaticities nan;
  nan.white.x = NAN;
  EXPECT_FALSE(RgbFromRgb(Chromaticities(), nan).has_value());
}

TEST(ImageColorTest, FilesStoreThePrimaries) {
  for (size_t i = 0; i < kPrimariesCount; ++i) {
    const auto primaries = static_cast<Primaries>(i);
    EXPECT_EQ(PrimariesFromName(PrimariesName(primaries)), primaries);
    FrameImage image = MakeFrameImage({0, 0, 4, 3}, 4, 3, {}, ColorOf(primaries));
    DevelopTile(MakeTestTile({0, 0, 4, 3}, {0, 32}), &image);
    const auto back = DecodeFrameImage(EncodeFrameImage(image));
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(back->color.chromaticities, image.color.chromaticities);
    EXPECT_EQ(ImageDigest(*back), ImageDigest(image));
    // The same numbers in other primaries are a different image.
    FrameImage other = *back;
    other.color.chromaticities.white.x += 0.01;
    EXPECT_NE(ImageDigest(other), ImageDigest(image));
  }
}

// The delivered image is the matrix times that of sRGB: light, its groups, albedo.
TEST(ImageColorTest, DevelopedColorsAreConvertedSrgb) {
  FilmOutputs outputs;
  outputs.light_groups = {"default", "key"};
  FilmTile tile({0, 0, 3, 2}, {0, 64}, outputs);
  PixelAccumulator accumulator(&tile);
  OutputSample out(outputs);
  for (int32_t y = 0; y < 2; ++y) {
    for (int32_t x = 0; x < 3; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t n = 0; n < 64; ++n) {
        const FilmSample s = MakeTestSample(x, y, n);
        for (size_t i = 0; i < 3; ++i) {
          out.means[i] = 0.25f * s.radiance[i];
          out.means[3 + i] = 0.75f * s.radiance[i];
        }
        accumulator.Add(n, s, out);
      }
      accumulator.End();
    }
  }
  FrameImage plain = MakeFrameImage({0, 0, 3, 2}, 3, 2, outputs);
  FrameImage aces = MakeFrameImage({0, 0, 3, 2}, 3, 2, outputs, ColorOf(Primaries::kAcesCg));
  DevelopTile(tile, &plain);
  DevelopTile(tile, &aces);
  const Matrix4 m = aces.color.light_from_srgb;
  for (const std::string prefix : {"", "albedo.", "default.", "key."}) {
    for (size_t p = 0; p < 6; ++p) {
      Vec3d srgb, wide;
      for (size_t i = 0; i < 3; ++i) {
        const std::string name = prefix + "RGB"[i];
        ASSERT_NE(plain.Find(name), nullptr) << name;
        srgb[i] = static_cast<double>((*plain.Find(name))[p]);
        wide[i] = static_cast<double>((*aces.Find(name))[p]);
      }
      const Vec3d expected = TransformVector(m, srgb);
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(wide[i], expected[i], 1e-6 * Length(srgb)) << prefix << " " << p;
      }
    }
  }
  for (const char* same : {"A", "normal.X", "depth.Z", "samples", "nonfinite"}) {
    EXPECT_EQ(*plain.Find(same), *aces.Find(same)) << same;
  }
}

// R, G and B of a sample are correlated. Here they are equal, so the standard error of a multiple
// is the multiple of the standard error. Adding the squares of the three errors would give another
// value.
TEST(ImageColorTest, StandardErrorsComeFromConvertedReplicates) {
  FilmTile tile({0, 0, 1, 1}, {0, 256});
  PixelAccumulator accumulator(&tile);
  accumulator.Begin(0, 0);
  for (uint64_t n = 0; n < 256; ++n) {
    const float v = HashToUnit(n);
    accumulator.Add(n, {.radiance = {v, 2 * v, 3 * v}, .filter_weight = 1});
  }
  accumulator.End();
  FrameImage plain = MakeFrameImage({0, 0, 1, 1}, 1, 1);
  FrameImage aces = MakeFrameImage({0, 0, 1, 1}, 1, 1, {}, ColorOf(Primaries::kAces2065));
  DevelopTile(tile, &plain);
  DevelopTile(tile, &aces);
  const double unit = static_cast<double>((*plain.Find("stderr.R"))[0]);
  ASSERT_GT(unit, 0.001);
  for (size_t i = 0; i < 3; ++i) {
    const auto& row = aces.color.light_from_srgb.m[i];
    const double expected = unit * std::fabs(row[0] + 2 * row[1] + 3 * row[2]);
    EXPECT_NEAR((*aces.Find(std::string("stderr.") + "RGB"[i]))[0], expected, 1e-5 * expected);
  }
}

// The estimated error depends little on the primaries, as it uses luminance.
TEST(ImageColorTest, LuminanceErrorUsesThePrimaries) {
  const FilmTile tile = MakeTestTile({0, 0, 8, 8}, {0, 64});
  FrameImage plain = MakeFrameImage({0, 0, 8, 8}, 8, 8);
  FrameImage wide = MakeFrameImage({0, 0, 8, 8}, 8, 8, {}, ColorOf(Primaries::kRec2020));
  DevelopTile(tile, &plain);
  DevelopTile(tile, &wide);
  EXPECT_NEAR(EstimateError(wide).standard_error / EstimateError(plain).standard_error, 1, 0.15);
}

TEST(ImageColorTest, ConversionsRoundTrip) {
  FrameImage image = MakeFrameImage({0, 0, 8, 8}, 8, 8);
  DevelopTile(MakeTestTile({0, 0, 8, 8}, {0, 16}), &image);
  FrameImage there = image;
  ASSERT_TRUE(ConvertColor(ChromaticitiesOf(Primaries::kAces2065), &there).ok());
  EXPECT_NE(*there.Find("R"), *image.Find("R"));
  EXPECT_EQ(*there.Find("albedo.R"), *image.Find("albedo.R"));
  ASSERT_TRUE(ConvertColor(Chromaticities(), &there).ok());
  const auto comparison = CompareImages(image, there);
  ASSERT_TRUE(comparison.ok());
  EXPECT_LT(comparison->relative_mse, 1e-12);
}

}  // namespace
}  // namespace sheaf
