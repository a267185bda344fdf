// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/render_command.h"

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr PixelRect kTile{32, 0, 64, 17};

TEST(RenderCommandTest, NamesTileSamplesSeedAndDepth) {
  FrameSettings settings;
  settings.seed = 9;
  settings.max_depth = 0;
  EXPECT_EQ(RenderCommand("shots/room.0007.pbrt", settings, kTile, 48),
            "sheaf render shots/room.0007.pbrt --crop 32,0,64,17 --samples 48 "
            "--max-depth 0 --seed 9 --techniques camera");
  settings.techniques = TechniqueSet::kCameraGuided;
  EXPECT_EQ(RenderCommand("room.pbrt", settings, kTile, 1),
            "sheaf render room.pbrt --crop 32,0,64,17 --samples 1 --max-depth 0 --seed 9 "
            "--techniques camera+guiding");
}

TEST(RenderCommandTest, HasEveryOptionThatAffectsPixels) {
  FrameSettings settings;
  settings.color = ColorTransport::kSpectral;
  settings.primaries = Primaries::kAcesCg;
  settings.single_scattering = settings.one_sequence = settings.force_generic_variant = true;
  settings.similarity_after = 8;
  settings.light_samples = 4;
  settings.techniques = TechniqueSet::kCameraAndLight;
  settings.outputs.Add(Aov::kUv);
  settings.outputs.AddIdNumber(IdKind::kAsset);
  settings.outputs.AddCryptomatte(IdKind::kObject);
  settings.outputs.AddCryptomatte(IdKind::kMaterial);
  settings.outputs.light_groups = {"key", "rim"};
  EXPECT_EQ(RenderCommand("a.pbrt", settings, kTile, 1),
            "sheaf render a.pbrt --crop 32,0,64,17 --samples 1 --max-depth 5 --seed 0 "
            "--color spectral --single-scattering --one-sequence --similarity 8 "
            "--light-samples 4 --techniques camera+light --generic --primaries acescg "
            "--aov uv,asset-id --cryptomatte object,material --light-groups");
}

// A stereo frame has one tile, the whole film, and no crop.
TEST(RenderCommandTest, StereoIsOneOption) {
  FrameSettings settings;
  settings.eye_distance = 0.0625f;
  EXPECT_EQ(RenderCommand("a.pbrt", settings, kTile, 8),
            "sheaf render a.pbrt --stereo 0.0625 --samples 8 --max-depth 5 --seed 0 "
            "--techniques camera");
  settings.eye_convergence = 2.5f;
  EXPECT_EQ(RenderCommand("a.pbrt", settings, kTile, 8),
            "sheaf render a.pbrt --stereo 0.0625,2.5 --samples 8 --max-depth 5 --seed 0 "
            "--techniques camera");
}

TEST(RenderCommandTest, FramesOfSharedPathsHaveNoCrop) {
  FrameSettings settings;
  settings.techniques = TechniqueSet{Technique::kSharing};
  EXPECT_EQ(RenderCommand("a.pbrt", settings, kTile, 8),
            "sheaf render a.pbrt --samples 8 --max-depth 5 --seed 0 --techniques camera+sharing");
}

TEST(RenderCommandTest, QuotesNamesForTheShell) {
  const auto start = [](const std::string& scene) {
    const std::string command = RenderCommand(scene, {}, kTile, 1);
    return command.substr(0, command.find(" --crop"));
  };
  EXPECT_EQ(start("my room.pbrt"), "sheaf render 'my room.pbrt'");
  EXPECT_EQ(start("it's; rm -rf $HOME"), "sheaf render 'it'\\''s; rm -rf $HOME'");
  EXPECT_EQ(start("-o"), "sheaf render './-o'");
  EXPECT_EQ(start("a\nb"), "sheaf render 'a\nb'");
  EXPECT_EQ(start(""), "sheaf render ''");
}

}  // namespace
}  // namespace sheaf::coordinator
