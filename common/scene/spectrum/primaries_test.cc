// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/spectrum/primaries.h"

#include "gtest/gtest.h"
#include "tests/support/colors.h"

namespace sheaf {
namespace {

using testing::ExpectNear;

Rgb ToRgb(Vec3d v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

TEST(PrimariesTest, NamesMatchPbrt) {
  EXPECT_EQ(PrimariesFromName("srgb"), Primaries::kSrgb);
  EXPECT_EQ(PrimariesFromName("ACES2065-1"), Primaries::kAces2065);
  EXPECT_EQ(PrimariesFromName("rec2020"), Primaries::kRec2020);
  EXPECT_EQ(PrimariesFromName("dci-p3"), Primaries::kDciP3);
  EXPECT_EQ(PrimariesFromName("acescg"), Primaries::kAcesCg);  // An extension of Sheaf.
  EXPECT_EQ(PrimariesFromName("adobe"), std::nullopt);
}

// The matrices of ITU-R BT.2087 and of Display P3.
TEST(PrimariesTest, WidePrimariesKeepTheWhitePoint) {
  struct Case {
    Primaries primaries;
    Rgb rgb, srgb;
  };
  const Case cases[] = {
      {Primaries::kRec2020, {1, 0, 0}, {1.6605f, -0.1246f, -0.0182f}},
      {Primaries::kRec2020, {0, 1, 0}, {-0.5876f, 1.1329f, -0.1006f}},
      {Primaries::kRec2020, {0, 0, 1}, {-0.0728f, -0.0083f, 1.1187f}},
      {Primaries::kDciP3, {1, 0, 0}, {1.2249f, -0.0420f, -0.0196f}},
      {Primaries::kDciP3, {0, 1, 0}, {-0.2247f, 1.0419f, -0.0786f}},
      {Primaries::kDciP3, {0, 0, 1}, {0, 0, 1.0979f}},
      {Primaries::kSrgb, {0.1f, 0.2f, 0.3f}, {0.1f, 0.2f, 0.3f}},
  };
  for (const Case& c : cases) {
    for (const ColorRole role : {ColorRole::kReflectance, ColorRole::kIlluminant}) {
      ExpectNear(SrgbFromPrimaries(c.rgb, c.primaries, role), c.srgb, 2e-3f);
    }
  }
}

// D60, the white of ACES, has x = 0.32168 and y = 0.33767, which in sRGB is somewhat red.
TEST(PrimariesTest, AcesWhiteIsD60LightAndUnitReflectance) {
  const Rgb light = SrgbFromPrimaries({1, 1, 1}, Primaries::kAces2065, ColorRole::kIlluminant);
  ExpectNear(light, {1.0470f, 0.9946f, 0.9155f}, 4e-3f);
  EXPECT_NEAR(Luminance(light), 1, 1e-3);
  for (const ColorRole role : {ColorRole::kReflectance, ColorRole::kUnbounded}) {
    EXPECT_EQ(SrgbFromPrimaries(Rgb::Gray(0.18f), Primaries::kAces2065, role), Rgb::Gray(0.18f));
    // The three primaries add up to white there too.
    const Rgb sum = SrgbFromPrimaries({1, 0, 0}, Primaries::kAces2065, role) +
                    SrgbFromPrimaries({0, 1, 0}, Primaries::kAces2065, role) +
                    SrgbFromPrimaries({0, 0, 1}, Primaries::kAces2065, role);
    ExpectNear(sum, {1, 1, 1}, 1e-5f);
  }
}

Vec3d Light(Primaries primaries, float white_balance_k, Vec3d srgb) {
  return TransformVector(ImageColorOf(primaries, white_balance_k).light_from_srgb, srgb);
}

TEST(PrimariesTest, SrgbImagesEqualTheSums) {
  EXPECT_TRUE(ImageColorOf(Primaries::kSrgb, 0).AsSummed());
  EXPECT_FALSE(ImageColorOf(Primaries::kSrgb, 6504).AsSummed());
  EXPECT_FALSE(ImageColorOf(Primaries::kAcesCg, 0).AsSummed());
}

// Colors given in primaries are delivered unchanged: lights up to the rounding of the white's five
// published digits; for reflectances white stays white.
TEST(PrimariesTest, DeliveredColorsMatchTheSceneFile) {
  for (size_t i = 0; i < kPrimariesCount; ++i) {
    const auto primaries = static_cast<Primaries>(i);
    SCOPED_TRACE(PrimariesName(primaries));
    const ImageColor color = ImageColorOf(primaries, 0);
    const Vec3d given{0.2, 0.5, 0.3};
    for (const ColorRole role : {ColorRole::kIlluminant, ColorRole::kReflectance}) {
      const Rgb srgb = SrgbFromPrimaries(ToRgb(given), primaries, role);
      const bool is_light = role == ColorRole::kIlluminant;
      const Vec3d delivered = TransformVector(
          is_light ? color.light_from_srgb : color.albedo_from_srgb,
          {static_cast<double>(srgb.r), static_cast<double>(srgb.g), static_cast<double>(srgb.b)});
      for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(delivered[k], given[k], 5e-4);
    }
    const Vec3d white = TransformVector(color.albedo_from_srgb, {1, 1, 1});
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(white[k], 1, 1e-12);
  }
}

// D65 in ACES2065-1, whose white is D60, keeps its color: its XYZ by the matrix of ST 2065-1.
TEST(PrimariesTest, NoAdaptationByDefault) {
  const Vec3d d65 = Light(Primaries::kAces2065, 0, {1, 1, 1});
  EXPECT_NEAR(0.9525523959 * d65.x + 0.0000936786 * d65.z, 0.95046, 1e-5);
  EXPECT_NEAR(0.3439664498 * d65.x + 0.7281660966 * d65.y - 0.0721325464 * d65.z, 1, 1e-9);
  EXPECT_NEAR(1.0088251844 * d65.z, 1.08906, 1e-5);
}

// The daylight or blackbody of the temperature becomes the white of the primaries.
TEST(PrimariesTest, WhiteBalanceMapsItsIlluminantToWhite) {
  struct Case {
    float temperature_k;
    double x, y;  // CIE 15:2004: D50, D55, D65, D75 as tabulated; A, a blackbody of 2856 K.
  };
  for (const Case& c :
       {Case{5000, 0.34567, 0.35850}, Case{5500, 0.33242, 0.34743}, Case{6500, 0.31272, 0.32903},
        Case{7500, 0.29902, 0.31485}, Case{2856, 0.44757, 0.40745}}) {
    for (const Primaries primaries : {Primaries::kSrgb, Primaries::kAces2065, Primaries::kAcesCg}) {
      SCOPED_TRACE(c.temperature_k);
      Matrix4 srgb_from_xyz;
      ASSERT_TRUE(Invert(*XyzFromRgb(Chromaticities()), &srgb_from_xyz));
      const Vec3d light = TransformVector(srgb_from_xyz, {c.x / c.y, 1, (1 - c.x - c.y) / c.y});
      const Vec3d white = Light(primaries, c.temperature_k, light);
      for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(white[i], 1, 2.5e-3) << i;
    }
  }
}

TEST(PrimariesTest, WhiteBalanceKeepsAlbedo) {
  EXPECT_EQ(ImageColorOf(Primaries::kSrgb, 3000).albedo_from_srgb, Matrix4());
  EXPECT_EQ(ImageColorOf(Primaries::kAcesCg, 3000).albedo_from_srgb,
            ImageColorOf(Primaries::kAcesCg, 0).albedo_from_srgb);
}

}  // namespace
}  // namespace sheaf
