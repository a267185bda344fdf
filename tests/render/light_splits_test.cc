// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests of several light samples at a vertex: the weights of a light sample and of scattering that
// hits the light sum to 1, and the image has the mean of single samples, with less noise.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <variant>
#include <vector>

#include "tests/support/frame_estimates.h"
#include "tests/support/guided_scenes.h"
#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/guiding_training.h"
#include "worker/render/integrator/path_integrator.h"
#include "worker/render/integrator/variants.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Bias;
using sheaf::testing::BiasOfNoisyPair;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;
using testing::Estimate;

constexpr Tint kColored{1};

struct Rendering {
  int32_t light_samples = 0;
  TechniqueSet techniques = TechniqueSet::kCamera;
  ColorTransport color = ColorTransport::kRgb;
  uint64_t seed = 0, samples = 64;
};

CompiledScenePtr CompileFor(const TestScene& scene, const Rendering& rendering) {
  FrameSettings settings = SquareSettings(kSizePx, rendering.samples, 4);
  settings.seed = rendering.seed;
  settings.color = rendering.color;
  settings.techniques = rendering.techniques;
  settings.light_samples = rendering.light_samples;
  return Compile(scene.scene, settings, kSmallTraining);
}

std::vector<Estimate> Render(const TestScene& scene, const Rendering& rendering) {
  return EstimatesOfBoth(RenderBothFilms(*CompileFor(scene, rendering)));
}

// Eight samples at a vertex have the mean of one.
void ExpectSplitsAgree(const std::string& name, const std::vector<TestScene>& scenes, double bias,
                       Rendering split) {
  split.light_samples = 8;
  split.samples = Samples(split.samples);
  Rendering one = split;
  one.light_samples = 0;
  std::vector<TilePair> tiles;
  uint64_t seed = 300;
  for (const TestScene& scene : scenes) {
    one.seed = seed++;
    split.seed = seed++;
    const std::vector<Estimate> of_one = Render(scene, one), of_split = Render(scene, split);
    for (size_t i = 0; i < of_one.size(); ++i) tiles.push_back({of_one[i], of_split[i]});
  }
  ExpectAgreement(name, bias, tiles);
}

TEST(LightSplitsTest, SeveralSamplesHaveTheMeanOfOne) {
  ExpectSplitsAgree("light splits",
                    {Diffuse(kColored), Glossy(kColored), Outdoor(kColored), Hazy(kColored),
                     ManyLights(kColored)},
                    BiasOfNoisyPair(), {});
}
TEST(LightSplitsTest, SeveralSamplesHaveTheMeanOfOneInMedia) {
  ExpectSplitsAgree("light splits in media", {Foggy(kColored), Cloudy(kColored)}, 2 * Bias(), {});
}
TEST(LightSplitsTest, SeveralSamplesHaveTheMeanOfOneInSpectra) {
  ExpectSplitsAgree("light splits, spectra", {Outdoor(kColored), ManyLights(kColored)}, 2 * Bias(),
                    {.color = ColorTransport::kSpectral});
}
TEST(LightSplitsTest, SeveralSamplesHaveTheMeanOfOneInGuidedFrames) {
  ExpectSplitsAgree("light splits, guided", {Outdoor(kColored), ManyLights(kColored)}, 2 * Bias(),
                    {.techniques = TechniqueSet::kCameraGuided});
}

// The noise of the whole image, as a fraction of that of single samples.
TEST(LightSplitsTest, SeveralSamplesHaveLessNoise) {
  const TestScene scene = ManyLights(kColored);
  const auto variance = [&](int32_t light_samples) {
    double sum = 0;
    for (const Estimate& tile : Render(scene, {.light_samples = light_samples})) {
      sum += tile.variance;
    }
    return sum;
  };
  const double one = variance(0), two = variance(2), eight = variance(8);
  std::printf("variance of 2 samples %.3f, of 8 samples %.3f\n", two / one, eight / one);
  EXPECT_LT(two, 0.9 * one);
  EXPECT_LT(eight, 0.75 * two);
}

TEST(LightSplitsTest, SeveralSamplesHaveTheMeanOfOneBesideLightPaths) {
  ExpectSplitsAgree("light splits beside light paths",
                    {Diffuse(kColored), Glossy(kColored), Outdoor(kColored), ManyLights(kColored)},
                    BiasOfNoisyPair(), {.techniques = TechniqueSet::kCameraAndLight});
}
TEST(LightSplitsTest, SeveralSamplesHaveTheMeanOfOneBesideLightPathsInMedia) {
  ExpectSplitsAgree("light splits beside light paths, media", {Foggy(kColored), Cloudy(kColored)},
                    2 * Bias(), {.techniques = TechniqueSet::kCameraAndLight});
}
TEST(LightSplitsTest, SeveralSamplesHaveLessNoiseBesideLightPaths) {
  const TestScene scene = ManyLights(kColored);
  const auto variance = [&](int32_t light_samples) {
    double sum = 0;
    for (const Estimate& tile : Render(scene, {.light_samples = light_samples,
                                              .techniques = TechniqueSet::kCameraAndLight})) {
      sum += tile.variance;
    }
    return sum;
  };
  const double one = variance(0), eight = variance(8);
  std::printf("variance of 8 samples beside light paths %.3f\n", eight / one);
  EXPECT_LT(eight, 0.85 * one);
}

TEST(LightSplitsTest, TheLimitHalvesWithEachScattering) {
  EXPECT_EQ(LightSamplesAt(8, 0), 8u);
  EXPECT_EQ(LightSamplesAt(8, 1), 4u);
  EXPECT_EQ(LightSamplesAt(8, 3), 1u);
  EXPECT_EQ(LightSamplesAt(8, kSubsurfaceVertex + 2), 1u);
  EXPECT_EQ(LightSamplesAt(5, 1), 2u);
  EXPECT_EQ(LightSamplesAt(0, 0), 1u);
}

// --- Weights -------------------------------------------------------------------------------------

// Follows camera paths, samples all parts of the lights at each vertex, and weighs each sample by
// both techniques.
template <TraitBits kTraits>
class WeightsOf {
 public:
  using C = IntegratorConfig<kTraits, const EmbreeScene, DirectLight::kByBoth>;

  explicit WeightsOf(const TestScene& scene)
      : compiled_(CompileFor(scene, {.light_samples = 16,
                                     .techniques = C::kGuided ? TechniqueSet::kCameraGuided
                                                              : TechniqueSet::kCamera})) {
    EXPECT_TRUE(EnsureGuiding(*compiled_, {}).ok());
    for (uint64_t i = 0; i < 1'000; ++i) Follow(i);
  }
  int samples() const { return samples_; }
  size_t parts_most() const { return parts_most_; }

 private:
  void Follow(uint64_t index) {
    const Sampler sampler(7, static_cast<int32_t>(index % kSizePx),
                          static_cast<int32_t>(index / kSizePx % kSizePx), index);
    LightGroups<Rgb> groups;
    Context<C> c{*compiled_, *compiled_->tracer, sampler, counts_, nullptr, groups, {}, {}};
    if constexpr (C::kGuided) c.guiding.fields = compiled_->guiding->fields();
    PathState<C> path;
    path.ray = compiled_->camera.template MakeRay<kTraits>(
        {0.5 + static_cast<double>(index % kSizePx),
         0.5 + static_cast<double>(index / kSizePx % kSizePx)},
        {}, 0, &weight_);
    path.camera_o = path.ray.o;
    if constexpr (C::kMedia) StartInMedia(c, &path);
    FilmSample unused;
    Vertex<C> vertex;
    for (;;) {
      NextVertex(c, &path, &vertex);
      auto* at = std::get_if<SurfaceVertex<C>>(&vertex);
      if (at == nullptr || !at->Arrive(c, &path, &unused) || at->bsdf.specular) return;
      SampleAt(c, *at, path);
      if (!at->Scatter(c, &path)) return;
      ASSERT_EQ(LightQueryAtLast<C>(path).samples_max, at->Query().samples_max);
    }
  }

  void SampleAt(const Context<C>& c, const SurfaceVertex<C>& at, PathState<C> path) {
    const LightQuery query = at.Query();
    if (query.samples_max <= 1) return;
    const LightTable& lights = *compiled_->lights;
    const Vec3f p = at.point.p, n = at.light_hint;
    const auto row = RowFor<kTraits>(query.row);
    const LightCut cut = lights.choice().CutAt(p, n, query.samples_max, row);
    parts_most_ = std::max(parts_most_, cut.size());
    for (uint32_t part = 0; part < cut.size(); ++part) {
      const std::array<float, 4> u = c.sampler.Get4(LightPartSlot(99, part));
      const Vec2f on_light{u[0], u[1]};
      const ChosenLight chosen =
          lights.choice().ChooseFrom(cut, part, p, n, u[2], SaltOf(on_light), row);
      const auto light =
          lights.SampleOfPart<kTraits>(chosen, p, n, on_light, path.wavelengths, query);
      if (!light || light->is_delta) continue;
      const BsdfValue value = at.Eval(light->wi);
      if (!(value.pdf > 0)) continue;
      // The same light, as scattering hits it.
      const float met =
          light->is_infinite
              ? lights.PdfEnvironment<kTraits>(p, n, light->wi, query)
              : lights.PdfEmitter<kTraits>(light->light, p, n, light->wi, light->p_light, query);
      const float sampled = at.LightSampleWeight(c, *light, value.pdf, path);
      const float hit = MisWeight<C>(FindsBy::kHit, value.pdf, met);
      EXPECT_NEAR(met, light->pdf, 2e-3f * met);
      EXPECT_NEAR(sampled + hit, 1, 2e-3f);
      ++samples_;
    }
  }

  CompiledScenePtr compiled_;
  RayCounts counts_;
  float weight_ = 1;
  int samples_ = 0;
  size_t parts_most_ = 0;
};

TEST(LightSplitsTest, WeightsSumToOne) {
  const WeightsOf<LightSplit(CommonTraits(true, false, false, true))> of(ManyLights(kColored));
  EXPECT_GT(of.samples(), 5'000);
  EXPECT_GT(of.parts_most(), 6u);
}
TEST(LightSplitsTest, WeightsSumToOneInGuidedFrames) {
  const WeightsOf<kAllTraits> of(ManyLights(kColored));
  EXPECT_GT(of.samples(), 5'000);
  EXPECT_GT(of.parts_most(), 6u);
}

}  // namespace
}  // namespace sheaf::render
