// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/rare_layers.h"

#include "gtest/gtest.h"

namespace sheaf {
namespace {

// Two tiles of 8 x 8 and two lights, of which "direct" is bright and uniform except for a shadow's
// edge.
FrameImage MakeLayeredImage() {
  FilmOutputs outputs;
  outputs.light_groups = {"direct", "sparkle"};
  FrameImage image = MakeFrameImage({4, 4, 20, 12}, 32, 32, outputs);
  for (const char* channel : {"direct.R", "direct.G", "direct.B"}) {
    std::vector<float>& plane = *image.Find(channel);
    for (size_t p = 0; p < plane.size(); ++p) plane[p] = p % 16 % 8 < 4 ? 10.0f : 0.0f;
  }
  for (const char* channel : {"stderr.R", "stderr.G", "stderr.B"}) {
    std::fill(image.Find(channel)->begin(), image.Find(channel)->end(), 1e-3f);
  }
  return image;
}

void AddRareSample(size_t p, float value, const char* layer, FrameImage* image) {
  (*image->Find(std::string(layer) + ".G"))[p] += value;
  (*image->Find("stderr.G"))[p] = value;
}

const std::vector<PixelRect> kTiles = {{4, 4, 12, 12}, {12, 4, 20, 12}};

TEST(RareLayersTest, FindsTheLayerOfRareSamples) {
  FrameImage image = MakeLayeredImage();
  AddRareSample(16 * 3 + 2, 1, "sparkle", &image);
  AddRareSample(16 * 5 + 8 + 1, 0.5f, "sparkle", &image);
  EXPECT_EQ(RareLayers(image, kTiles), (std::vector<LayerCount>{{"sparkle", 2}}));
  AddRareSample(16 * 2 + 8 + 6, 4, "direct", &image);
  EXPECT_EQ(RareLayers(image, kTiles), (std::vector<LayerCount>{{"direct", 1}, {"sparkle", 1}}));
}

TEST(RareLayersTest, CoversTheImageBorder) {
  FrameImage image = MakeLayeredImage();
  AddRareSample(0, 1, "sparkle", &image);
  AddRareSample(16 * 8 - 1, 1, "sparkle", &image);
  EXPECT_EQ(RareLayers(image, kTiles), (std::vector<LayerCount>{{"sparkle", 2}}));
}

TEST(RareLayersTest, EmptyWithoutLayersOrTiles) {
  EXPECT_TRUE(RareLayers(MakeLayeredImage(), {}).empty());
  EXPECT_TRUE(RareLayers(MakeFrameImage({0, 0, 8, 8}, 8, 8), kTiles).empty());
}

}  // namespace
}  // namespace sheaf
