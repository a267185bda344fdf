// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/image/view_transform.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "cli/image/tone_map.h"
#include "cli/image/view_config.h"

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;

FrameImage ImageOf(const std::vector<std::array<float, 3>>& colors, Primaries primaries) {
  FrameImage frame_image;
  frame_image.window = {0, 0, static_cast<int32_t>(colors.size()), 1};
  frame_image.color.chromaticities = ChromaticitiesOf(primaries);
  frame_image.channel_names = {"R", "G", "B"};
  frame_image.planes.resize(3);
  for (const std::array<float, 3>& color : colors) {
    for (size_t c = 0; c < 3; ++c) frame_image.planes[c].push_back(color[c]);
  }
  return frame_image;
}

ViewTransform Opened(const std::string& view, const std::string& config = "") {
  absl::StatusOr<ViewTransform> opened = ViewTransform::Open({config, "", view});
  EXPECT_TRUE(opened.ok()) << opened.status();
  return opened.ok() ? *opened : ViewTransform();
}

void ExpectNear(const std::vector<Rgb8>& shown, const std::vector<Rgb8>& expected, int steps) {
  ASSERT_EQ(shown.size(), expected.size());
  for (size_t i = 0; i < shown.size(); ++i) {
    EXPECT_NEAR(shown[i].r, expected[i].r, steps) << "r of color " << i;
    EXPECT_NEAR(shown[i].g, expected[i].g, steps) << "g of color " << i;
    EXPECT_NEAR(shown[i].b, expected[i].b, steps) << "b of color " << i;
  }
}

// Writes text to a file that belongs to this test.
std::string WriteConfig(const std::string& name, const std::string& text) {
  const std::string path = ::testing::TempDir() + "/" + name;
  std::ofstream(path) << text;
  return path;
}

// 18 % gray, a red, a blue and four times white.
const std::vector<std::array<float, 3>> kColors = {
    {0.18f, 0.18f, 0.18f}, {0.8f, 0.1f, 0.05f}, {0.02f, 0.05f, 0.6f}, {4, 4, 4}};

// The expected values follow from IEC 61966-2-1 and, for ACEScg, from matrices of the
// chromaticities.
TEST(ViewTransformTest, BuiltInSrgbViewAppliesOnlyTheSrgbCurve) {
  const ViewTransform view = Opened("srgb");
  EXPECT_EQ(view.view(), "sRGB");
  EXPECT_EQ(*view.Show(ImageOf(kColors, Primaries::kSrgb)),
            (std::vector<Rgb8>{{118, 118, 118}, {231, 89, 63}, {39, 63, 203}, {255, 255, 255}}));
  EXPECT_EQ(*view.Show(ImageOf(kColors, Primaries::kAcesCg)),
            (std::vector<Rgb8>{{120, 117, 113}, {255, 21, 40}, {0, 62, 208}, {255, 255, 255}}));
}

// The expected values are those of the Academy's RRT and its ODT for Rec. 709 of 100 nits with a
// dim surround (aces-dev 1.0.3), computed from the published equations and encoded by the sRGB
// curve. The white of both images is the white of ACES.
TEST(ViewTransformTest, AcesShowsRec709AndAcesCg) {
  const ViewTransform view = Opened("ACES 1.0 SDR");
  ExpectNear(*view.Show(ImageOf(kColors, Primaries::kSrgb)),
             {{91, 91, 91}, {190, 66, 41}, {0, 32, 175}, {244, 244, 244}}, 1);
  ExpectNear(*view.Show(ImageOf(kColors, Primaries::kAcesCg)),
             {{91, 91, 91}, {226, 14, 30}, {0, 30, 185}, {244, 244, 244}}, 1);
}

// The same light looks the same in any primaries that share a white.
TEST(ViewTransformTest, AcesShowsTheSameLightInAnyPrimaries) {
  const ViewTransform view = Opened("ACES 1.0 SDR");
  const FrameImage srgb = ImageOf(kColors, Primaries::kSrgb);
  FrameImage wide = srgb;
  ASSERT_TRUE(ConvertColor(ChromaticitiesOf(Primaries::kRec2020), &wide).ok());
  ExpectNear(*view.Show(wide), *view.Show(srgb), 1);
}

TEST(ViewTransformTest, RawShowsValuesOfAnyPrimaries) {
  const ViewTransform view = Opened("Raw");
  for (const Primaries primaries : {Primaries::kSrgb, Primaries::kAcesCg}) {
    EXPECT_EQ(*view.Show(ImageOf(kColors, primaries)),
              (std::vector<Rgb8>{{46, 46, 46}, {204, 26, 13}, {5, 13, 153}, {255, 255, 255}}));
  }
}

// Compares the library's transforms with our own over the whole range, in small steps.
TEST(ViewTransformTest, ConfigSrgbMatchesToneMapSrgb) {
  std::vector<std::array<float, 3>> colors;
  for (int i = 0; i <= 4000; ++i) {
    const float light = static_cast<float>(i - 100) / 3000;
    colors.push_back({light, light * light, 1 - light});
  }
  const FrameImage frame_image = ImageOf(colors, Primaries::kSrgb);
  const ViewTransform view = Opened("sRGB", WriteConfig("own.ocio", std::string(kOwnViewConfig)));
  ExpectNear(*view.Show(frame_image), ToneMapSrgb(frame_image), 1);
}

TEST(ViewTransformTest, NonFiniteValuesAreClamped) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const FrameImage frame_image =
      ImageOf({{kInfinity, kInfinity, kInfinity}, {std::nanf(""), std::nanf(""), std::nanf("")}},
              Primaries::kSrgb);
  for (const char* name : {"sRGB", "ACES 1.0 SDR", "Raw"}) {
    const std::vector<Rgb8> shown = *Opened(name).Show(frame_image);
    EXPECT_GT(shown[0].g, 240) << name;
    EXPECT_EQ(shown[1].g, 0) << name;
  }
}

TEST(ViewTransformTest, ErrorsListAvailableViews) {
  EXPECT_THAT(ViewTransform::Open({"", "", "Filmic"}).status().message(),
              HasSubstr("has no view \"Filmic\"; it has: sRGB, ACES 1.0 SDR, Raw"));
  EXPECT_THAT(ViewTransform::Open({"", "TV", ""}).status().message(),
              HasSubstr("Sheaf's own config has no display \"TV\"; it has: sRGB"));
  EXPECT_THAT(ViewTransform::Open({"/nowhere/config.ocio", "", ""}).status().message(),
              HasSubstr("--ocio /nowhere/config.ocio: "));
  const std::string broken = WriteConfig("broken.ocio", "ocio_profile_version: [");
  EXPECT_EQ(ViewTransform::Open({broken, "", ""}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

// A config of profile 1 that names its scene-linear space as older configs did, with a plain gamma
// 2 view and a missing look-up table.
constexpr const char* kStudioConfig = R"(ocio_profile_version: 1
roles:
  default: raw
displays:
  Monitor:
    - !<View> {name: Root, colorspace: root}
    - !<View> {name: Lost, colorspace: lost}
active_displays: [Monitor]
active_views: []
colorspaces:
  - !<ColorSpace> {name: NAME}
  - !<ColorSpace> {name: raw, isdata: true}
  - !<ColorSpace>
    name: root
    from_reference: !<ExponentTransform> {value: [0.5, 0.5, 0.5, 1]}
  - !<ColorSpace>
    name: lost
    from_reference: !<FileTransform> {src: lost.spi1d, interpolation: linear}
)";
std::string StudioConfig(const std::string& name) {
  std::string text = kStudioConfig;
  return text.replace(text.find("NAME"), 4, name);
}

TEST(ViewTransformTest, AcceptsAUserConfig) {
  const std::string path = WriteConfig("studio.ocio", StudioConfig("lin_rec709"));
  const ViewTransform view = Opened("", path);
  EXPECT_EQ(view.view(), "Root");
  EXPECT_FALSE(view.Tags().is_srgb);
  EXPECT_EQ(view.Tags().text.at("Display"), "Monitor");
  ExpectNear(*view.Show(ImageOf({{0.25f, 0.01f, 1}}, Primaries::kSrgb)), {{128, 26, 255}}, 1);
  EXPECT_THAT(ViewTransform::Open({path, "", "Lost"}).status().message(), HasSubstr("lost.spi1d"));
}

TEST(ViewTransformTest, RefusesAConfigWithoutAKnownSpace) {
  const std::string path = WriteConfig("unknown.ocio", StudioConfig("mine"));
  EXPECT_THAT(ViewTransform::Open({path, "", ""}).status().message(),
              HasSubstr("aces_interchange"));
}

TEST(ViewTransformTest, PngTagsNameTheView) {
  const std::string path = ::testing::TempDir() + "/view.png";
  ASSERT_TRUE(WriteView(Opened("ACES 1.0 SDR"), ImageOf(kColors, Primaries::kSrgb), path).ok());
  std::ifstream file(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  EXPECT_THAT(bytes, HasSubstr(std::string("View\0ACES 1.0 SDR", 17)));
  EXPECT_THAT(bytes, HasSubstr("sRGB"));  // The chunk of that name.
}

FrameImage GrayImage(const std::vector<float>& values) {
  FrameImage image;
  image.window = {0, 0, static_cast<int32_t>(values.size()), 1};
  image.channel_names = {"R", "G", "B"};
  image.planes.assign(3, values);
  return image;
}

TEST(ViewTransformTest, ViewsShowTheExposedValues) {
  const FrameImage image = GrayImage({0.18f * 1024, 4096, 0});
  ViewArguments arguments;
  arguments.exposure = "-10";
  EXPECT_EQ(*ViewTransform::Open(arguments)->Show(image),
            (std::vector<Rgb8>{{118, 118, 118}, {255, 255, 255}, {0, 0, 0}}));
  arguments.view = "Raw";
  EXPECT_EQ(*ViewTransform::Open(arguments)->Show(image),
            (std::vector<Rgb8>{{46, 46, 46}, {255, 255, 255}, {0, 0, 0}}));
  // Numbers that are no light have no automatic exposure.
  arguments.exposure = "auto";
  EXPECT_EQ(ViewTransform::Open(arguments)->StopsFor(image), 0);
  arguments.view = "ACES 1.0 SDR";
  EXPECT_NE(ViewTransform::Open(arguments)->StopsFor(image), 0);
  arguments.exposure = "light";
  EXPECT_THAT(std::string(ViewTransform::Open(arguments).status().message()),
              HasSubstr("--exposure: expected"));
}

}  // namespace
}  // namespace sheaf::cli
