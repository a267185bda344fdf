// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests that the densities that paths carry (RunningDensity) are those of whole paths: random light
// paths are stored, followed again from the lens, vertex by vertex, and for each pair of techniques
// the ratio that either end carries is compared with that of LogDensityOf. The weights of all
// techniques that find a path sum to 1.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "tests/support/densities/followed_paths.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kTolerance = 1e-4;

template <TraitBits kTraits>
class PathDensityTest : public FollowedPaths<kTraits> {
 protected:
  using typename FollowedPaths<kTraits>::Carried;
  using typename FollowedPaths<kTraits>::Found;
  using FromLens = typename FollowedPaths<kTraits>::FromLens;
  static constexpr bool kGuided = FollowedPaths<kTraits>::kGuided;

  // Whether all ratios are those of the reference.
  bool Agrees(const Found& found, const Carried& carried);
  // off_max: the part of all paths that may differ.
  void ExpectDensities(const std::vector<DensityScene>& scenes, TechniqueSet techniques,
                       uint64_t light_paths, double off_max);

  bool may_be_off_ = false;
  double worst_ = 0;
};

template <TraitBits kTraits>
bool PathDensityTest<kTraits>::Agrees(const Found& found, const Carried& carried) {
  const double hit = LogDensityOf(found.path, FindsBy::kHit, *this->compiled_),
               sample = LogDensityOf(found.path, FindsBy::kLightSample, *this->compiled_),
               line = LogDensityOf(found.path, FindsBy::kLine, *this->compiled_),
               light =
                   LogDensityOf(found.path, found.is_merged ? FindsBy::kMerge : FindsBy::kLightPath,
                                *this->compiled_);
  bool agrees = true;
  const auto compare = [&](const char* pair, double ratio, double log_ratio) {
    const double error = std::fabs(ratio / std::exp(log_ratio) - 1);
    if (error <= kTolerance) {
      worst_ = std::max(worst_, error);
      return;
    }
    agrees = false;
    if (may_be_off_) return;
    ADD_FAILURE() << pair << ": " << ratio << " instead of " << std::exp(log_ratio) << " at "
                  << found.path.places.size() << " vertices";
  };
  if (hit > -kInfinity) compare("light over hit", carried.light_over_hit, light - hit);
  if (hit > -kInfinity && sample > -kInfinity) {
    compare("sample over hit", carried.sample_over_hit, sample - hit);
  }
  if (sample > -kInfinity) compare("light over sample", carried.light_over_sample, light - sample);
  if (line > -kInfinity) compare("line over sample", carried.line_over_sample, line - sample);
  const double most = std::max({hit, sample, line});
  if (most > -kInfinity) {
    const double camera =
        most + 0.5 * std::log(std::exp(2 * (hit - most)) + std::exp(2 * (sample - most)) +
                              std::exp(2 * (line - most)));
    compare("camera over light", found.camera_over_light, camera - light);
  }
  return agrees;
}

template <TraitBits kTraits>
void PathDensityTest<kTraits>::ExpectDensities(const std::vector<DensityScene>& scenes,
                                               TechniqueSet techniques, uint64_t light_paths,
                                               double off_max) {
  may_be_off_ = off_max > 0;
  for (const DensityScene& scene : scenes) {
    SCOPED_TRACE(scene.name);
    this->Load(scene.scene, techniques);
    std::vector<Found> found;
    for (uint64_t i = 0; i < light_paths; ++i) this->AddPaths(i, &found);
    size_t followed = 0, compared = 0, off = 0, longest = 0, specular = 0, media = 0, guided = 0,
           lines = 0, merged = 0, from_media = 0;
    for (Found& path : found) {
      const std::optional<Carried> carried = this->Follow(&path);
      if (!carried) continue;
      if (path.is_merged) {
        // Rough glass is left to camera paths.
        if (!(carried->merge_radius > 0)) continue;
        this->Merge(carried->merge_radius, &path);
        merged += path.weight > 0.1f;
      }
      ++followed;
      from_media += path.path.light.is_medium;
      longest = std::max(longest, path.path.places.size());
      bool is_specular = false, in_medium = false, is_guided = false;
      for (const auto& place : path.path.places) {
        is_specular = is_specular || place.is_specular;
        in_medium = in_medium || !std::holds_alternative<SurfaceVertex<FromLens>>(place.from_lens);
        is_guided = is_guided || WithScatterer<FromLens>(place.from_lens, [](const auto& at) {
                      return at.ScatteringShare() < 1;
                    });
      }
      specular += is_specular;
      media += in_medium;
      guided += is_guided;
      if (PathDensities<kTraits>(path.path, *this->compiled_).IsGrazing()) continue;
      ++compared;
      lines += carried->line_weight > 0.1;
      const double sum = static_cast<double>(path.weight) + carried->sample_weight +
                         carried->hit_weight + carried->line_weight;
      const bool sums = std::fabs(sum - 1) <= kTolerance;
      EXPECT_TRUE(sums || may_be_off_) << sum;
      if (!Agrees(path, *carried) || !sums) ++off;
      if (off > 5 && !may_be_off_) break;
    }
    std::printf(
        "%s, %s: %zu of %zu paths, %zu compared, up to %zu vertices, %zu specular, "
        "%zu in media, %zu by lines, %zu merged, %zu from media, %zu off\n",
        scene.name, techniques.Name().c_str(), followed, found.size(), compared, longest, specular,
        media, lines, merged, from_media, off);
    EXPECT_LE(static_cast<double>(off), static_cast<double>(followed) * off_max);
    EXPECT_GT(compared, 200u);
    EXPECT_GE(merged, this->compiled_->gather_step > 0 ? followed / 20 : 0);
    EXPECT_GE(from_media, scene.has_emission ? followed / 4 : 0);
    EXPECT_GT(compared, followed / 3);
    // Glossy glass is left out of what the mirror shows.
    const double followed_min = this->compiled_->gather_step > 0 ? 0.5 : 0.9;
    EXPECT_GT(static_cast<double>(followed), followed_min * static_cast<double>(found.size()));
    EXPECT_GE(specular, scene.is_specular ? followed / 20 : 0);
    EXPECT_GE(media, scene.has_media ? followed / 20 : 0);
    EXPECT_GE(lines, scene.has_media ? followed / 50 : 0);
    EXPECT_GE(guided, kGuided ? followed / 2 : 0);
  }
  std::printf("largest error of a ratio: %.2g\n", worst_);
}

constexpr TraitBits kPlainTraits = CommonTraits(false, false, false, false);
using SurfaceDensityTest = PathDensityTest<kPlainTraits>;
using SkyDensityTest = PathDensityTest<CommonTraits(true, false, false, true)>;
using MediumDensityTest = PathDensityTest<kColoredMediaTraits>;
using CloudDensityTest = PathDensityTest<kCloudTraits>;
using SplitDensityTest = PathDensityTest<LightSplit(kPlainTraits)>;
using GuidedDensityTest = PathDensityTest<Guided(kPlainTraits)>;
using SpectralDensityTest = PathDensityTest<Spectrally(kPlainTraits)>;

TEST_F(SurfaceDensityTest, RatiosAreThoseOfWholePaths) {
  for (const TechniqueSet techniques : {TechniqueSet::kCameraAndLight, TechniqueSet::kLight}) {
    ExpectDensities(SurfaceScenes(), techniques, 2'000, 0);
  }
}
TEST_F(SurfaceDensityTest, RatiosAreThoseOfWholePathsForAllCameras) {
  ExpectDensities(CameraScenes(), TechniqueSet::kCameraAndLight, 2'000, 0);
}
TEST_F(SkyDensityTest, RatiosAreThoseOfWholePaths) {
  ExpectDensities(SkyScenes(), TechniqueSet::kCameraAndLight, 2'000, 0);
}
TEST_F(MediumDensityTest, RatiosAreThoseOfWholePaths) {
  ExpectDensities(MediumScenes(), TechniqueSet::kCameraAndLight, 1'000, 0);
}
TEST_F(CloudDensityTest, RatiosAreThoseOfWholePaths) {
  ExpectDensities(CloudScenes(), TechniqueSet::kCameraAndLight, 2'000, 0);
}
TEST_F(SplitDensityTest, RatiosAreThoseOfWholePaths) {
  ExpectDensities(SplitScenes(), TechniqueSet::kCameraAndLight, 2'000, 0);
}
TEST_F(SurfaceDensityTest, RatiosAreThoseOfWholePathsWhereLightPathsAreMerged) {
  ExpectDensities(MirrorScenes(),
                  TechniqueSet(TechniqueSet::kCameraAndLight).With(sheaf::Technique::kMerging),
                  4'000, 0);
}
TEST_F(MediumDensityTest, RatiosAreThoseOfWholePathsFromEmissiveMedia) {
  ExpectDensities(GasScenes(), TechniqueSet::kCameraAndLight, 2'000, 0);
}
TEST_F(CloudDensityTest, RatiosAreThoseOfWholePathsFromFlames) {
  ExpectDensities(FlameScenes(), TechniqueSet::kCameraAndLight, 5'000, 0);
}
TEST_F(SpectralDensityTest, RatiosAreThoseOfWholePaths) {
  ExpectDensities(SpectralScenes(), TechniqueSet::kCameraAndLight, 2'000, 0);
}
// The two ends of a path round its points differently, and at the border of two regions the
// field's density jumps.
TEST_F(GuidedDensityTest, RatiosAreThoseOfWholePaths) {
  ExpectDensities(GuidedScenes(), TechniqueSet::kCameraAndLightGuided, 2'000, 0.01);
}

}  // namespace
}  // namespace sheaf::render
