// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/api/http_preview.h"

#include "gtest/gtest.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

PreviewChoice Choose(ImageLayer layer) {
  PreviewChoice choice;
  choice.layer = layer;
  return choice;
}

TEST(HttpPreviewTest, EncodesOncePerVersionAndLayer) {
  FakeFarm farm;
  farm.preview.version = 3;
  farm.preview.image = MakeFakeImage(4, 2, 0.5f);
  FrameView frame = MakeFakeJob("1").frames[0];
  PreviewCache cache;
  const auto png = [&](ImageLayer layer) {
    return cache.Find(farm, "1", frame, Choose(layer))->png;
  };
  const auto first = cache.Find(farm, "1", frame, Choose(ImageLayer::kImage));
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(first->version, 3u);
  EXPECT_EQ(first->png.substr(1, 3), "PNG");
  EXPECT_FALSE(first->range.has_value());
  // The farm continues, but the cached image still answers requests for its version and layer.
  farm.preview.version = 4;
  farm.preview.image = MakeFakeImage(4, 2, 0.1f);
  EXPECT_EQ(png(ImageLayer::kImage), first->png);
  EXPECT_NE(png(ImageLayer::kLight), first->png);
  const auto samples = cache.Find(farm, "1", frame, Choose(ImageLayer::kSamples));
  ASSERT_TRUE(samples.ok()) << samples.status();
  EXPECT_EQ(samples->range, (LayerRange{16, 16}));
  frame.preview_version = 4;
  EXPECT_NE(png(ImageLayer::kImage), first->png);
  EXPECT_EQ(cache.Find(farm, "1", frame, Choose(ImageLayer::kImage))->version, 4u);
}

}  // namespace
}  // namespace sheaf::coordinator
