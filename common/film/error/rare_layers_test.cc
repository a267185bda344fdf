// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/rare_layers.h"

#include "gtest/gtest.h"

namespace sheaf {
namespace {

// Two tiles of 8 x 8 and two lights, of which "direct" is bright and uniform except for a shadow's
// edge.
FramePicture MakePicture() {
  FilmOutputs outputs;
  outputs.light_groups = {"direct", "sparkle"};
  FramePicture picture = MakeFramePicture({4, 4, 20, 12}, 32, 32, outputs);
  for (const char* channel : {"direct.R", "direct.G", "direct.B"}) {
    std::vector<float>& plane = *picture.Find(channel);
    for (size_t p = 0; p < plane.size(); ++p) plane[p] = p % 16 % 8 < 4 ? 10.0f : 0.0f;
  }
  for (const char* channel : {"stderr.R", "stderr.G", "stderr.B"}) {
    std::fill(picture.Find(channel)->begin(), picture.Find(channel)->end(), 1e-3f);
  }
  return picture;
}

void AddRareSample(size_t p, float value, const char* layer, FramePicture* picture) {
  (*picture->Find(std::string(layer) + ".G"))[p] += value;
  (*picture->Find("stderr.G"))[p] = value;
}

const std::vector<PixelRect> kTiles = {{4, 4, 12, 12}, {12, 4, 20, 12}};

TEST(RareLayersTest, BlamesTheLayerOfTheRareSampleAndNotTheBrightOne) {
  FramePicture picture = MakePicture();
  AddRareSample(16 * 3 + 2, 1, "sparkle", &picture);
  AddRareSample(16 * 5 + 8 + 1, 0.5f, "sparkle", &picture);
  EXPECT_EQ(RareLayers(picture, kTiles), (std::vector<LayerCount>{{"sparkle", 2}}));
  AddRareSample(16 * 2 + 8 + 6, 4, "direct", &picture);
  EXPECT_EQ(RareLayers(picture, kTiles), (std::vector<LayerCount>{{"direct", 1}, {"sparkle", 1}}));
}

TEST(RareLayersTest, ReachesTheRimsOfThePicture) {
  FramePicture picture = MakePicture();
  AddRareSample(0, 1, "sparkle", &picture);
  AddRareSample(16 * 8 - 1, 1, "sparkle", &picture);
  EXPECT_EQ(RareLayers(picture, kTiles), (std::vector<LayerCount>{{"sparkle", 2}}));
}

TEST(RareLayersTest, NothingWithoutLayersOrTiles) {
  EXPECT_TRUE(RareLayers(MakePicture(), {}).empty());
  EXPECT_TRUE(RareLayers(MakeFramePicture({0, 0, 8, 8}, 8, 8), kTiles).empty());
}

}  // namespace
}  // namespace sheaf
