// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/primaries.h"

#include "gtest/gtest.h"

namespace sheaf {
namespace {

void ExpectNear(Rgb a, Rgb b, float tolerance) {
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], tolerance) << "channel " << i;
}

TEST(PrimariesTest, NamesAreThoseOfPbrt) {
  EXPECT_EQ(PrimariesFromName("srgb"), Primaries::kSrgb);
  EXPECT_EQ(PrimariesFromName("ACES2065-1"), Primaries::kAces2065);
  EXPECT_EQ(PrimariesFromName("rec2020"), Primaries::kRec2020);
  EXPECT_EQ(PrimariesFromName("dci-p3"), Primaries::kDciP3);
  EXPECT_EQ(PrimariesFromName("adobe"), std::nullopt);
}

// The matrices of ITU-R BT.2087 and of Display P3.
TEST(PrimariesTest, WidePrimariesOfTheSameWhite) {
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
TEST(PrimariesTest, WhiteOfAcesIsALightOfD60AndASurfaceThatReflectsAll) {
  const Rgb light = SrgbFromPrimaries({1, 1, 1}, Primaries::kAces2065, ColorRole::kIlluminant);
  ExpectNear(light, {1.0470f, 0.9946f, 0.9155f}, 4e-3f);
  EXPECT_NEAR(Luminance(light), 1, 1e-3);
  for (const ColorRole role : {ColorRole::kReflectance, ColorRole::kUnbounded}) {
    EXPECT_EQ(SrgbFromPrimaries(Rgb::Grey(0.18f), Primaries::kAces2065, role), Rgb::Grey(0.18f));
    // The three primaries add up to white there too.
    const Rgb sum = SrgbFromPrimaries({1, 0, 0}, Primaries::kAces2065, role) +
                    SrgbFromPrimaries({0, 1, 0}, Primaries::kAces2065, role) +
                    SrgbFromPrimaries({0, 0, 1}, Primaries::kAces2065, role);
    ExpectNear(sum, {1, 1, 1}, 1e-5f);
  }
}

}  // namespace
}  // namespace sheaf
