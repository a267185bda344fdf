// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Grids with a single value, in scene files: the plan treats them as homogeneous media, and their
// images equal those of homogeneous media to the bit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/scene/pbrt/scene_reader.h"
#include "tests/support/interior_scene.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {
namespace {

constexpr char kColored[] =
    " \"rgb sigma_a\" [0.2 0.1 0.05] \"rgb sigma_s\" [1 2 3] \"float g\" 0.4 \"rgb Le\" "
    "[0.1 0.2 0.3]\n";
constexpr char kGray[] = " \"rgb sigma_a\" [0.1 0.1 0.1] \"rgb sigma_s\" [2 2 2]\n";
std::string Grid(int side, const char* coefficients) {
  std::string cells;
  for (int i = 0; i < side * side * side; ++i) cells += " 2";
  return absl::StrCat("MakeNamedMedium \"smoke\" \"string type\" \"uniformgrid\" \"integer nx\" ",
                      side, " \"integer ny\" ", side, " \"integer nz\" ", side,
                      " \"point3 p0\" [-2 -2 -2] \"point3 p1\" [2 2 2] \"float density\" [", cells,
                      "]", coefficients);
}
std::string Fog() {
  return absl::StrCat("MakeNamedMedium \"smoke\" \"string type\" \"homogeneous\" \"float scale\" 2",
                      kColored);
}

SceneDescription Read(const std::string& medium) {
  const std::string folder = ::testing::TempDir() + "sheaf-constant-grid";
  EXPECT_TRUE(MakeDirectories(folder).ok());
  const std::string text = absl::StrCat(
      "LookAt 0 1 -5 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" 40\n"
      "WorldBegin\nLightSource \"infinite\" \"rgb L\" [0.5 0.7 1] AttributeBegin Translate 0 3 0 "
      "AreaLightSource \"diffuse\" Shape \"sphere\" \"float radius\" 0.5 AttributeEnd\n",
      medium,
      "Material \"interface\"\nMediumInterface \"smoke\" \"\"\n"
      "Shape \"sphere\" \"float radius\" 1\n");
  EXPECT_TRUE(WriteFileAtomically(folder + "/main.pbrt", text).ok());
  DirectoryFileSource files(folder);
  absl::StatusOr<ReadSceneResult> result = ReadScene("main.pbrt", files);
  EXPECT_TRUE(result.ok()) << result.status().message();
  return result.ok() ? std::move(result->scene) : SceneDescription();
}

TEST(ConstantGridTest, ImageMatchesTheHomogeneousMedium) {
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    FrameSettings settings = SquareSettings(16, 32, 16);
    settings.color = color;
    const Rendered grid = RenderCounted(Read(Grid(4, kColored)), settings);
    const Rendered fog = RenderCounted(Read(Fog()), settings);
    ExpectSameBits(grid.film, fog.film);
    EXPECT_GT(grid.mean.mean.g, 0.1f);
  }
}

// Within its outermost values, a constant grid that stays a grid equals the homogeneous medium:
// tracking gives the same mean.
TEST(ConstantGridTest, TrackingHasTheSameMean) {
  SceneDescription tracked = Read(Grid(4, kColored));
  UniformGridMedium one;
  one.box = {{4, 4, 4}, {-2, -2, -2}, {2, 2, 2}};
  one.density.assign(64, 1.0f);
  tracked.media[0].kind = one;
  FrameSettings settings = SquareSettings(16, 128, 16);
  ASSERT_TRUE(Has(MakeRenderPlan(tracked, settings).traits, Trait::kHeterogeneousMedia));
  const Rendered with = RenderCounted(tracked, settings);
  settings.seed = 1;
  ExpectSameMean(with.mean, RenderCounted(Read(Fog()), settings).mean);
}

TEST(ConstantGridTest, PlanReportsTheConversion) {
  const FrameSettings settings = SquareSettings(16, 1, 16);
  const RenderPlan plan = MakeRenderPlan(Read(Grid(4, kGray)), settings);
  EXPECT_FALSE(Has(plan.traits, Trait::kHeterogeneousMedia));
  EXPECT_FALSE(Has(plan.variant_traits, Trait::kHeterogeneousMedia));
  EXPECT_THAT(FormatRenderPlan(plan),
              ::testing::HasSubstr("main.pbrt:5:1: medium \"smoke\": constant grid: treated as "
                                   "homogeneous\n"));
  // A grid of one cell falls to 0 from its center outwards.
  const RenderPlan coarse = MakeRenderPlan(Read(Grid(1, kGray)), settings);
  EXPECT_TRUE(Has(coarse.traits, Trait::kHeterogeneousMedia));
  EXPECT_THAT(
      FormatRenderPlan(coarse),
      ::testing::HasSubstr(
          "constant grid: stays a grid, because the shape at main.pbrt:8:1 reaches beyond"));
}

}  // namespace
}  // namespace sheaf::render
