// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/image_start.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/film/light/light_image.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

constexpr PixelRect kStartWindow{0, 0, 16, 8};
constexpr char kProfile[] = "this build";

FrameSpec MakeSpec() {
  FrameSpec spec;
  spec.scene = {std::string(64, 'a'), 7};
  spec.settings.width_px = 16;
  spec.settings.height_px = 8;
  spec.settings.window = kStartWindow;
  spec.frame_digest = FrameDigest(spec.scene.sha256_hex, spec.settings, kProfile);
  return spec;
}

// Every pixel is 1 with a standard error of 0.1; the right half has four times the samples and half
// the standard error.
FrameImage MakeImage() {
  FrameImage image = MakeFrameImage(kStartWindow, 16, 8);
  const auto set = [&](const std::string& name, auto value_at) {
    for (size_t c = 0; c < image.channel_names.size(); ++c) {
      if (image.channel_names[c] != name) continue;
      for (size_t p = 0; p < image.planes[c].size(); ++p) {
        image.planes[c][p] = value_at(p % 16 >= 8);
      }
    }
  };
  for (const char* name : {"R", "G", "B", "A"}) set(name, [](bool) { return 1.0f; });
  for (const char* name : {"stderr.R", "stderr.G", "stderr.B"}) {
    set(name, [](bool right) { return right ? 0.05f : 0.1f; });
  }
  set("samples", [](bool right) { return right ? 64.0f : 16.0f; });
  image.metadata[kFrameDigestKey] = MakeSpec().frame_digest;
  image.metadata[kImageDigestKey] = ImageDigest(image);
  return image;
}

const CellGrid kStartGrid(kStartWindow, 8, 8);

TEST(ImageStartTest, CellsHaveTheImagesSamplesAndErrors) {
  const auto resumed = ResumeImage(MakeImage(), MakeSpec(), kProfile);
  ASSERT_TRUE(resumed.ok()) << resumed.status();
  const auto start = ImageStartOf(*resumed, kStartGrid);
  ASSERT_TRUE(start.ok()) << start.status();
  ASSERT_EQ(start->cells.size(), 2u);
  EXPECT_EQ(start->cells[0].samples, 16u);
  EXPECT_EQ(start->cells[1].samples, 64u);
  // The squared values and the floor of dark pixels are estimates, accurate to a few hundredths.
  EXPECT_NEAR(start->cells[0].error.RelativeMse(), 0.01, 0.001);
  EXPECT_NEAR(start->cells[1].error.RelativeMse(), 0.0025, 0.00025);
}

TEST(ImageStartTest, CostCountsOnlyMissingSamples) {
  ErrorModel model;
  for (int i = 0; i < 2; ++i) {
    model.cells.push_back({{16, {64, 64 * 0.5, 64 * 0.25}}, 64e-3});  // Much too noisy.
  }
  model.log_error_deviation = 0.4;
  model.log_cpu_deviation = 0.1;
  ContinueFrom(*ImageStartOf(*ResumeImage(MakeImage(), MakeSpec(), kProfile), kStartGrid), &model);
  EXPECT_LT(model.log_error_deviation, 0.2);  // 128 pixels.
  EXPECT_EQ(model.log_cpu_deviation, 0.1);
  const Forecast same = ForecastSamples(model, 64);
  EXPECT_DOUBLE_EQ(same.cpu_seconds, 64e-3 * 48);  // The left half.
  const Forecast more = ForecastTarget(model, {.target_error = 1e-3}, 1 << 16);
  EXPECT_TRUE(more.reached);
  EXPECT_NEAR(more.cpu_seconds, 64e-3 * (2 * more.samples - 16 - 64), 1e-9);
  // An error of 0.0063 at 40 samples reaches 0.001 at some 240, plus some for the confidence.
  EXPECT_GT(more.samples, 150);
  EXPECT_LT(more.samples, 500);
}

TEST(ImageStartTest, ExplainsWhyAnImageDoesNotFit) {
  const auto why = [](FrameImage image, const FrameSpec& spec, const char* profile = kProfile) {
    return std::string(ResumeImage(std::move(image), spec, profile).status().message());
  };
  FrameSpec other = MakeSpec();
  other.frame_digest = "another";
  other.settings.seed = 3;
  FrameImage image = MakeImage();
  image.metadata["numericProfile"] = kProfile;
  image.metadata["size"] = "16x8";
  image.metadata["window"] = "0,0,16,8";
  image.metadata["seed"] = "0";
  EXPECT_THAT(why(image, other), HasSubstr("another seed"));
  EXPECT_THAT(why(image, other, "a later build"), HasSubstr("another build"));
  image.metadata["seed"] = "3";
  image.metadata["depthMax"] = "5";
  image.metadata["techniques"] = "light";
  EXPECT_THAT(why(image, other), HasSubstr("with other --techniques (it has techniques \"light\", "
                                           "the job \"camera\")"));
  image.metadata.erase("techniques");
  EXPECT_THAT(why(image, other), HasSubstr("from another scene"));
  FrameSpec few = MakeSpec();
  few.settings.lattice = PixelLattice{8, 1};
  EXPECT_THAT(why(MakeImage(), few), HasSubstr("not all of its pixels"));
  FrameImage changed = MakeImage();
  changed.planes[0][0] += 1;
  EXPECT_THAT(why(changed, MakeSpec()), HasSubstr("changed after it was delivered"));
}

// An image of MakeSpec with light paths: of the variance of its pixels, light passes have this
// fraction.
FrameSpec WithLight(FrameSpec spec, TechniqueSet techniques = TechniqueSet::kCameraAndLight) {
  spec.settings.techniques = techniques;
  spec.frame_digest = FrameDigest(spec.scene.sha256_hex, spec.settings, kProfile);
  return spec;
}
FrameImage MakeLightImage(const FrameSpec& spec, float fraction) {
  FrameImage image = MakeImage(), light = image;
  for (const char* name : {"stderr.R", "stderr.G", "stderr.B"}) {
    for (float& error : *light.Find(name)) error *= std::sqrt(fraction);
  }
  light.Find("samples")->assign(light.planes[0].size(), 64);
  SetLightLayer(light, &image);
  image.metadata[kFrameDigestKey] = spec.frame_digest;
  image.metadata[kImageDigestKey] = ImageDigest(image);
  return image;
}

TEST(ImageStartTest, ErrorsAreDividedBetweenCameraAndLight) {
  const FrameSpec spec = WithLight(MakeSpec());
  const auto all = ImageStartOf(*ResumeImage(MakeImage(), MakeSpec(), kProfile), kStartGrid);
  EXPECT_TRUE(all->light_errors.empty());
  const auto resumed = ResumeImage(MakeLightImage(spec, 0.75f), spec, kProfile);
  ASSERT_TRUE(resumed.ok()) << resumed.status();
  const auto start = ImageStartOf(*resumed, kStartGrid);
  ASSERT_TRUE(start.ok()) << start.status();
  EXPECT_EQ(start->light_passes, 64u);
  EXPECT_DOUBLE_EQ(start->SamplesPerPixel(), 40);
  EXPECT_NEAR(start->RelativeMse(), all->RelativeMse(), 1e-9);
  ASSERT_EQ(start->light_errors.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    const double error = all->cells[i].error.RelativeMse();
    EXPECT_NEAR(start->cells[i].error.RelativeMse(), 0.25 * error, 1e-6 * error);
    EXPECT_NEAR(start->light_errors[i].RelativeMse(), 0.75 * error, 1e-6 * error);
  }
}

TEST(ImageStartTest, CostCountsOnlyMissingLightPasses) {
  const FrameSpec spec = WithLight(MakeSpec());
  const auto resumed = ResumeImage(MakeLightImage(spec, 0.75f), spec, kProfile);
  ErrorModel model;
  for (int i = 0; i < 2; ++i) model.cells.push_back({{16, {64, 64 * 0.5, 64 * 0.25}}, 64e-3});
  model.light = {8, {{64, 64, 64}, {64, 64, 64}}, 0.5, 0.1, 0};  // Much too noisy.
  const auto start = ImageStartOf(*resumed, kStartGrid);
  ContinueFrom(*start, &model);
  EXPECT_LT(model.light.log_error_deviation, 0.3);
  const Forecast more = ForecastSamples(model, 256);
  EXPECT_DOUBLE_EQ(more.cpu_seconds, 64e-3 * (2 * 256 - 16 - 64) + 0.1 * (256 - 64));
  // Errors of light passes fall by a factor of four, those of camera samples by more.
  EXPECT_LT(more.relative_mse, start->RelativeMse() / 4);
  EXPECT_GT(more.relative_mse, start->RelativeMse() * 0.75 / 4);
}

TEST(ImageStartTest, ImagesWithoutALightLayerAreRefused) {
  for (const TechniqueSet techniques :
       {TechniqueSet::kCameraAndLight, TechniqueSet::kLight, TechniqueSet::kCameraAndLightGuided}) {
    const FrameSpec spec = WithLight(MakeSpec(), techniques);
    EXPECT_TRUE(ResumeImage(MakeLightImage(spec, 0.5f), spec, kProfile).ok());
    FrameImage image = MakeImage();
    image.metadata[kFrameDigestKey] = spec.frame_digest;
    const absl::Status status = ResumeImage(std::move(image), spec, kProfile).status();
    EXPECT_THAT(std::string(status.message()), HasSubstr("has no channel light.mean.R"));
    EXPECT_THAT(std::string(status.message()), HasSubstr("sheaf refine"));
  }
}

TEST(ImageStartTest, GuidedImagesOfTheCameraContinue) {
  FrameSpec spec = MakeSpec();
  spec.settings.techniques = TechniqueSet::kCameraGuided;
  spec.frame_digest = FrameDigest(spec.scene.sha256_hex, spec.settings, kProfile);
  FrameImage image = MakeImage();
  image.metadata[kFrameDigestKey] = spec.frame_digest;
  const auto resumed = ResumeImage(std::move(image), spec, kProfile);
  EXPECT_TRUE(resumed.ok()) << resumed.status();
}

TEST(ImageStartTest, OtherCellSizesAreRefused) {
  const auto resumed = ResumeImage(MakeImage(), MakeSpec(), kProfile);
  ASSERT_TRUE(resumed.ok());
  EXPECT_FALSE(ImageStartOf(*resumed, CellGrid(kStartWindow, 16, 16)).ok());
}

}  // namespace
}  // namespace sheaf::coordinator
