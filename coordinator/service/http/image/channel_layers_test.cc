// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/image/channel_layers.h"

#include <algorithm>
#include <set>

#include "absl/strings/str_cat.h"
#include "common/film/denoised_output.h"
#include "coordinator/service/http/image/false_color.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

const ChannelLayer* Find(const std::vector<ChannelLayer>& layers, const std::string& name) {
  const auto found = std::find_if(layers.begin(), layers.end(),
                                  [&](const ChannelLayer& layer) { return layer.name == name; });
  return found == layers.end() ? nullptr : &*found;
}

TEST(ChannelLayersTest, NamesEachChannelOnceButThoseOfTheImage) {
  FilmOutputs outputs;
  ASSERT_TRUE(AddAovs("position,normal-geometric,uv,motion,object-id", &outputs).ok());
  ASSERT_TRUE(AddCryptomattes("object", &outputs).ok());
  outputs.light_groups = {"default", "key"};
  const std::vector<ChannelLayer> layers = ChannelLayersOf(outputs);
  std::set<std::string> names;
  for (const ChannelLayer& layer : layers) {
    EXPECT_TRUE(names.insert(layer.name).second) << layer.name;
    for (const std::string& channel : layer.channels) {
      EXPECT_NE(MakeFrameImage({0, 0, 1, 1}, 1, 1, outputs).Find(channel), nullptr) << channel;
    }
  }
  ASSERT_NE(Find(layers, "albedo"), nullptr);
  EXPECT_EQ(*Find(layers, "albedo"),
            (ChannelLayer{"albedo", ChannelKind::kColor, {"albedo.R", "albedo.G", "albedo.B"}}));
  EXPECT_EQ(Find(layers, "normal")->kind, ChannelKind::kDirection);
  EXPECT_EQ(Find(layers, "P")->kind, ChannelKind::kVector);
  EXPECT_EQ(Find(layers, "depth")->channels, std::vector<std::string>{"depth.Z"});
  EXPECT_EQ(Find(layers, "key")->kind, ChannelKind::kColor);
  EXPECT_EQ(Find(layers, "objectId")->kind, ChannelKind::kId);
  EXPECT_EQ(Find(layers, "CryptoObject00")->kind, ChannelKind::kId);
  EXPECT_EQ(Find(layers, "CryptoObject01"), nullptr) << "the second ids hide behind the first";
  for (const char* of_image : {"R", "samples", "stderr"})
    EXPECT_EQ(Find(layers, of_image), nullptr);
}

TEST(ChannelLayersTest, EachKindHasItsColors) {
  FrameImage image = MakeFrameImage({0, 0, 2, 1}, 2, 1);
  *image.Find("albedo.R") = {1, 0};
  *image.Find("normal.X") = {1, -1};
  *image.Find("depth.Z") = {2, 6};
  const auto display = [&](const std::string& name) {
    const std::vector<ChannelLayer> layers = ChannelLayersOf({});
    auto made = MakeChannelDisplay(image, *Find(layers, name), ImageLayer::kImage);
    EXPECT_TRUE(made.ok()) << made.status();
    return *std::move(made);
  };
  EXPECT_EQ(display("albedo").pixels[0], (Rgb8{255, 0, 0}));
  EXPECT_EQ(display("normal").pixels[0], (Rgb8{255, 128, 128}));
  EXPECT_EQ(display("normal").pixels[1], (Rgb8{0, 128, 128}));
  const DisplayImage depth = display("depth");
  ASSERT_TRUE(depth.range.has_value());
  EXPECT_EQ(depth.range->low, 2);
  EXPECT_EQ(depth.pixels[0], Viridis(0));
}

TEST(ChannelLayersTest, ErrorsAreRelativeToTheirColor) {
  FilmOutputs outputs;
  AddDenoised(&outputs);
  const std::vector<ChannelLayer> layers = ChannelLayersOf(outputs);
  EXPECT_EQ(Find(layers, "denoised")->kind, ChannelKind::kColor);
  const ChannelLayer* const layer = Find(layers, "denoisedError");
  ASSERT_NE(layer, nullptr);
  EXPECT_EQ(layer->kind, ChannelKind::kError);
  // Dark pixels, bright ones, and one without samples; the error is the same.
  FrameImage image = MakeFrameImage({0, 0, 201, 1}, 201, 1, outputs);
  const auto fill = [&image](const std::string& channel, float dark, float bright) {
    std::vector<float>& plane = *image.Find(channel);
    std::fill(plane.begin(), plane.begin() + 100, dark);
    std::fill(plane.begin() + 100, plane.end() - 1, bright);
  };
  fill("samples", 4, 4);
  for (const char* component : {"R", "G", "B"}) {
    fill(absl::StrCat("denoised.", component), 1, 100);
    fill(absl::StrCat("denoisedError.", component), 1, 1);
  }
  for (const std::string& channel : SourceChannels(*layer)) {
    EXPECT_NE(image.Find(channel), nullptr) << channel;
  }
  const auto display = MakeChannelDisplay(image, *layer, ImageLayer::kImage);
  ASSERT_TRUE(display.ok()) << display.status();
  ASSERT_TRUE(display->range.has_value());
  EXPECT_LT(display->range->low, 0.02);
  EXPECT_GT(display->range->high, 0.1);
  EXPECT_GT(display->pixels[0].r, display->pixels[150].r) << "dark pixels have larger errors";
  EXPECT_NE(display->pixels[200], display->pixels[150]) << "pixels without samples are unknown";
}

TEST(ChannelLayersTest, AMissingChannelIsNamed) {
  const FrameImage image = MakeFrameImage({0, 0, 1, 1}, 1, 1);
  const ChannelLayer layer{"key", ChannelKind::kColor, {"key.R", "key.G", "key.B"}};
  const auto display = MakeChannelDisplay(image, layer, ImageLayer::kImage);
  EXPECT_TRUE(absl::IsInternal(display.status())) << display.status();
}

}  // namespace
}  // namespace sheaf::coordinator
