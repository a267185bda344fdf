// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/image_start.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
  const auto cells = ImageStartOf(*resumed, kStartGrid);
  ASSERT_TRUE(cells.ok()) << cells.status();
  ASSERT_EQ(cells->size(), 2u);
  EXPECT_EQ((*cells)[0].samples, 16u);
  EXPECT_EQ((*cells)[1].samples, 64u);
  // The squared values and the floor of dark pixels are estimates, accurate to a few hundredths.
  EXPECT_NEAR((*cells)[0].error.RelativeMse(), 0.01, 0.001);
  EXPECT_NEAR((*cells)[1].error.RelativeMse(), 0.0025, 0.00025);
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

TEST(ImageStartTest, ImagesWithLightPathsAreRefused) {
  FrameSpec spec = MakeSpec();
  for (const Techniques techniques :
       {Techniques::kCameraAndLight, Techniques::kLight, Techniques::kCameraAndLightGuided}) {
    spec.settings.techniques = techniques;
    spec.frame_digest = FrameDigest(spec.scene.sha256_hex, spec.settings, kProfile);
    FrameImage image = MakeImage();
    image.metadata[kFrameDigestKey] = spec.frame_digest;
    const absl::Status status = ResumeImage(std::move(image), spec, kProfile).status();
    EXPECT_THAT(std::string(status.message()), HasSubstr("an image holds only their sum"));
  }
}

TEST(ImageStartTest, GuidedImagesOfTheCameraContinue) {
  FrameSpec spec = MakeSpec();
  spec.settings.techniques = Techniques::kCameraGuided;
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
