// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the measurement that decides whether light paths and guiding pay.
#include "worker/render/ablation/technique_measurement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "tests/support/guided_scenes.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/ablation/technique_pilot.h"
#include "worker/render/guiding_training.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;

TechniqueMeasurement Measure(const TestScene& t, uint64_t samples = 16,
                             TechniqueEffort effort = TechniqueEffort::kAsked) {
  TableFileSource files({});
  const absl::StatusOr<TechniqueMeasurement> measured =
      MeasureTechniques(t.scene, SquareSettings(96, samples, 6), files, effort);
  EXPECT_TRUE(measured.ok()) << measured.status();
  return measured.ok() ? *measured : TechniqueMeasurement{};
}

// A glass ball between a floor and a light of the given radius; 0: without size.
TestScene Caustic(float radius) {
  TestScene t = OpenBox({1});
  t.AddShape(kBall, t.AddMaterial(DielectricMaterial{}), TranslateMatrix({0, 0.9, 0}));
  if (radius > 0) {
    const float area = radius * radius;
    t.AddShape(SphereShape{radius, -radius, radius, 360}, t.Diffuse({}),
               TranslateMatrix({0.5, 2.6, -0.3}))
        .area_light = t.AreaLight(Rgb::Gray(1 / area));
  } else {
    PointLight lamp;
    lamp.intensity.rgb = Rgb::Gray(3);
    lamp.from = {0.5f, 2.6f, -0.3f};
    t.scene.lights.push_back({lamp, {}, {}, {}});
  }
  return t;
}

TEST(TechniqueMeasurementTest, LightPathsPayForCaustics) {
  const TechniqueMeasurement measured = Measure(Caustic(0.05f));
  EXPECT_GT(measured.Gain(measured.Best()), 5);
  EXPECT_TRUE(HasLightPaths(measured.Best())) << FormatTechniqueMeasurement(measured);
  EXPECT_GT(measured.light_share, 0.01);
  EXPECT_LT(measured.light_share, 0.5);
  EXPECT_EQ(measured.only_light_share, 0);
  EXPECT_EQ(measured.width_px, 32);
  EXPECT_GT(measured.both.cost_rays, measured.camera.cost_rays);
  EXPECT_THAT(FormatTechniqueMeasurement(measured), HasSubstr("techniques: camera+light"));
}

// The smaller the light, the rarer camera paths find its caustic, and a small image may contain
// nothing of it: the second moment from light paths still tells.
TEST(TechniqueMeasurementTest, GainGrowsForLightsThatCameraPathsMiss) {
  const auto gain_of = [](const TechniqueMeasurement& measured) {
    return measured.Gain(measured.Best());
  };
  const double of_small = gain_of(Measure(Caustic(0.01f))),
               of_large = gain_of(Measure(Caustic(0.1f)));
  EXPECT_GT(of_small, 5 * of_large) << of_small << " " << of_large;
}

// A floor behind a pane of glass, through which both a small lamp and the camera look at it.
TestScene ShopWindow() {
  TestScene t({0, 1, -3.2}, {0, 0, 0}, 40);
  t.AddShape(MeshShape{t.Quad({-2, 0, -1}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -1})},
             t.Diffuse({0.6f, 0.5f, 0.4f}));
  const uint32_t glass = t.AddMaterial(DielectricMaterial{});
  for (const float z : {-1.2f, -1.1f}) {
    t.AddShape(MeshShape{z < -1.15f ? t.Quad({-3, 0, z}, {-3, 3, z}, {3, 3, z}, {3, 0, z})
                                    : t.Quad({-3, 0, z}, {3, 0, z}, {3, 3, z}, {-3, 3, z})},
               glass);
  }
  t.AddShape(SphereShape{0.01f, -0.01f, 0.01f, 360}, t.Diffuse({}), TranslateMatrix({0.4, 1.5, -3}))
      .area_light = t.AreaLight(Rgb::Gray(3e4f));
  return t;
}

// Neither paths from the camera nor light paths see what a lamp lights through a window that the
// camera looks through: chains do, and tell how noisy it is by the others.
TEST(TechniqueMeasurementTest, ChainsPayThroughAWindow) {
  const TechniqueMeasurement window = Measure(ShopWindow());
  ASSERT_TRUE(window.chained.has_value());
  EXPECT_GT(window.chained->relative_mse, 0);
  const TechniqueSet chains{Technique::kChains};
  EXPECT_GT(window.Gain(chains), 100);
  EXPECT_GT(window.Gain(chains), 100 * window.Gain(TechniqueSet::kCameraAndLight));
  EXPECT_THAT(FormatTechniqueMeasurement(window), HasSubstr("camera+chains"));
  // Merging gains more, and is biased: it is no choice where no flag asks.
  EXPECT_TRUE(MergesLightPaths(window.Best())) << FormatTechniqueMeasurement(window);
  const TechniqueMeasurement unasked = Measure(ShopWindow(), 4096, TechniqueEffort::kUnasked);
  EXPECT_EQ(unasked.Best(), chains) << FormatTechniqueMeasurement(unasked);
  EXPECT_FALSE(Measure(ShopWindow(), 2048, TechniqueEffort::kUnasked).chained.has_value());
  // No lamp of a size, and no glass.
  EXPECT_FALSE(Measure(Caustic(0)).chained.has_value());
  EXPECT_FALSE(Measure(ManyLights({1})).chained.has_value());
}

TEST(TechniqueMeasurementTest, ChainsMustPay) {
  const TechniqueSet chains{Technique::kChains};
  TechniqueMeasurement measured;
  measured.camera = measured.guided = {10, 1};
  measured.both = {2, 1};
  measured.chained = {1.9, 1};
  EXPECT_EQ(measured.Best(), TechniqueSet::kCameraAndLight);
  measured.chained = {1, 1};
  EXPECT_EQ(measured.Best(), chains);
  measured.chained = {1, 3};
  EXPECT_EQ(measured.Best(), TechniqueSet::kCameraAndLight);
}

// Learned lights are measured where there are lights to choose among, and pay where most of them
// are behind walls: in a hall of which half is hidden they do not.
TEST(TechniqueMeasurementTest, LearnedLightsAreMeasuredAmongManyLights) {
  const TechniqueMeasurement rooms = Measure(ClosedRooms({1}), 64);
  ASSERT_TRUE(rooms.learned_lights.has_value());
  EXPECT_GT(rooms.learned_lights->cost_rays, rooms.camera.cost_rays);
  EXPECT_GT(rooms.GainOfLearnedLights(), kCombinationGainMin);
  EXPECT_TRUE(LearnsLights(rooms.Best())) << FormatTechniqueMeasurement(rooms);
  EXPECT_THAT(FormatTechniqueMeasurement(rooms), HasSubstr("learned lights are"));
  const TechniqueMeasurement hall = Measure(DividedHall({1}), 64);
  ASSERT_TRUE(hall.learned_lights.has_value());
  EXPECT_LT(hall.GainOfLearnedLights(), kCombinationGainMin);
  EXPECT_FALSE(LearnsLights(hall.Best())) << FormatTechniqueMeasurement(hall);
  // One lamp leaves no choice.
  EXPECT_FALSE(Measure(Caustic(0.05f)).learned_lights.has_value());
}

// Choices by product are measured where there are many lights and a surface that reflects few of
// them.
TEST(TechniqueMeasurementTest, ProductsAreMeasuredWhereManyLightsAreOverGloss) {
  const TechniqueMeasurement gloss = Measure(LampsOverGloss({1}, 0.1f), 64);
  ASSERT_TRUE(gloss.product.has_value());
  EXPECT_GT(gloss.product->ErrorTimesCost(), 0);
  EXPECT_THAT(FormatTechniqueMeasurement(gloss), HasSubstr("lights by product are"));
  EXPECT_FALSE(Measure(ManyLights({1})).product.has_value());  // Diffuse.
  EXPECT_FALSE(Measure(Caustic(0.05f)).product.has_value());   // One lamp.
}

TEST(TechniqueMeasurementTest, ProductsMustPay) {
  TechniqueMeasurement measured;
  measured.camera = measured.guided = measured.both = {1, 1};
  measured.product = {0.8, 1};
  EXPECT_EQ(measured.Best(), TechniqueSet::kCamera);
  measured.product = {0.5, 1};
  EXPECT_EQ(measured.Best(), TechniqueSet{Technique::kProduct});
  measured.learned_lights = {0.4, 1};
  EXPECT_EQ(measured.Best(), TechniqueSet{Technique::kLearnedLights});
  measured.product = {0.3, 1};
  EXPECT_EQ(measured.Best(), TechniqueSet{Technique::kProduct});
}

TEST(TechniqueMeasurementTest, CameraPathsSufficeForOpenLight) {
  for (const TestScene& scene : {Diffuse({1}), ManyLights({1})}) {
    const TechniqueMeasurement measured = Measure(scene);
    EXPECT_EQ(measured.Best(), TechniqueSet::kCamera) << FormatTechniqueMeasurement(measured);
    EXPECT_LT(measured.Gain(TechniqueSet::kCameraAndLight), 1);
  }
}

TEST(TechniqueMeasurementTest, LightThatCameraPathsCannotFindIsTold) {
  const TechniqueMeasurement measured = Measure(Caustic(0));
  EXPECT_GT(measured.only_light_share, 0.005);
  EXPECT_GT(measured.missing_mse, 0);
  EXPECT_LT(measured.Gain(TechniqueSet::kCameraGuided), 1.1);
  EXPECT_TRUE(HasLightPaths(measured.Best())) << FormatTechniqueMeasurement(measured);
  EXPECT_THAT(FormatTechniqueMeasurement(measured), HasSubstr("light paths alone find"));
}

// Light that camera paths miss is an error that samples do not reduce: it decides where the frame
// has little noise, and not where it has much.
TEST(TechniqueMeasurementTest, MissingLightWeighsByTheSamplesOfTheFrame) {
  TechniqueMeasurement measured;
  measured.camera = measured.guided = {2, 1};
  measured.both = {2, 3};
  measured.only_light_share = 0.03;
  measured.missing_mse = 0.01;
  const auto gain_at = [&](uint64_t samples) {
    measured.frame_samples = samples;
    return measured.Gain(TechniqueSet::kCameraAndLight);
  };
  EXPECT_NEAR(gain_at(1), 2.04 / 6, 1e-12);
  EXPECT_EQ(measured.Best(), TechniqueSet::kCamera);
  EXPECT_NEAR(gain_at(10'000), 402.0 / 6, 1e-12);
  EXPECT_EQ(measured.Best(), TechniqueSet::kCameraAndLight);
  EXPECT_EQ(measured.Gain(TechniqueSet::kCameraGuided), 1);
}

// Only where it gains enough against the same techniques without.
TEST(TechniqueMeasurementTest, SplittingMustPay) {
  TechniqueMeasurement measured;
  measured.camera = {100, 1};
  measured.both = {90, 2};
  const auto best_of = [&](TechniqueCost guided, TechniqueCost guided_both, TechniqueCost split) {
    measured.guided = guided;
    measured.guided_both = guided_both;
    measured.split = split;
    return measured.Best();
  };
  EXPECT_EQ(best_of({1, 2}, {2, 2}, {0.7, 2}), TechniqueSet::kCameraGuidedSplit);
  EXPECT_EQ(measured.Gain(TechniqueSet::kCameraGuidedSplit), 100 / 1.4);
  EXPECT_THAT(FormatTechniqueMeasurement(measured), HasSubstr("; camera+guiding+splitting 71"));
  EXPECT_EQ(best_of({1, 2}, {2, 2}, {0.9, 2}), TechniqueSet::kCameraGuided);
  EXPECT_EQ(best_of({1, 2}, {2, 2}, {0, 2}), TechniqueSet::kCameraGuided);
  EXPECT_EQ(best_of({10, 2}, {1, 2}, {0.7, 2}), TechniqueSet::kCameraAndLightGuidedSplit);
  measured.split.reset();
  EXPECT_EQ(measured.Best(), TechniqueSet::kCameraAndLightGuided);
}

TEST(TechniqueMeasurementTest, GuidedEmissionMustPay) {
  TechniqueMeasurement measured;
  measured.camera = {100, 1};
  measured.both = {10, 2};
  measured.guided = {90, 2};
  const TechniqueSet guided = TechniqueSet::kCameraAndLight.With(Technique::kEmissionGuiding);
  const auto best_of = [&](TechniqueCost emission_guided) {
    measured.emission_guided = emission_guided;
    return measured.Best();
  };
  EXPECT_EQ(best_of({2, 4}), guided);
  EXPECT_EQ(measured.Gain(guided), 100.0 / 8);
  EXPECT_THAT(FormatTechniqueMeasurement(measured),
              HasSubstr("guided emission is 2.5 times as efficient"));
  EXPECT_EQ(best_of({9, 2}), TechniqueSet::kCameraAndLight);
  EXPECT_EQ(best_of({0, 2}), TechniqueSet::kCameraAndLight);
  // Light that only light paths find.
  measured.only_light_share = 0.1;
  measured.missing_mse = 1;
  measured.frame_samples = 1000;
  EXPECT_EQ(best_of({2, 4}), guided);
  EXPECT_EQ(measured.Gain(guided), 4100.0 / 8);
}

// The sun shines on a wide plain, of which the picture shows a glass ball and its caustic: most
// light paths miss it. A field of few paths would be a worse one than the frame has.
TEST(TechniqueMeasurementTest, GuidedEmissionIsTrainedAsInTheFrame) {
  TestScene t({0, 1.5, -4}, {0, 0.5, 0}, 40);
  t.AddShape(MeshShape{t.Quad({-10, 0, -10}, {-10, 0, 10}, {10, 0, 10}, {10, 0, -10})},
             t.Diffuse({0.5f, 0.5f, 0.5f}));
  t.AddShape(kBall, t.AddMaterial(DielectricMaterial{}), TranslateMatrix({0, 0.9, 0}));
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(3);
  sun.from = {0.5f, 1, -0.3f};
  sun.to = {0, 0, 0};
  t.scene.lights.push_back({sun, {}, {}, {}});
  const TechniqueMeasurement measured = Measure(t, 128);
  ASSERT_TRUE(measured.emission_guided) << FormatTechniqueMeasurement(measured);
  const TechniqueSet merging = measured.BaseOfLight().With(Technique::kMerging);
  EXPECT_GT(measured.Gain(merging.With(Technique::kEmissionGuiding)), 3 * measured.Gain(merging))
      << FormatTechniqueMeasurement(measured);
  EXPECT_TRUE(GuidesEmission(measured.Best())) << FormatTechniqueMeasurement(measured);
}

// A plane in the sun under a slab of smooth glass: camera paths find it never, and nor do light
// paths but by merging.
TEST(TechniqueMeasurementTest, MergingIsMeasuredBehindGlassAlone) {
  TestScene t({0, 4, 0}, {0, 0, 0}, 36, {0, 0, 1});
  t.AddShape(MeshShape{t.Quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2})},
             t.Diffuse({0.5f, 0.5f, 0.5f}));
  t.AddShape(MeshShape{t.Box({-2, 0.05f, -2}, {2, 0.1f, 2})}, t.AddMaterial(DielectricMaterial{}));
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(3);
  sun.from = {0.6f, 0.8f, 0};
  sun.to = {0, 0, 0};
  t.scene.lights.push_back({sun, {}, {}, {}});
  const TechniqueMeasurement measured = Measure(t);
  ASSERT_TRUE(measured.merged) << FormatTechniqueMeasurement(measured);
  EXPECT_TRUE(MergesLightPaths(measured.Best())) << FormatTechniqueMeasurement(measured);
  EXPECT_GT(measured.unmerged_missing_mse, 0.1);
  EXPECT_LT(measured.bias_mse, 0.01 * measured.unmerged_missing_mse);
  EXPECT_THAT(FormatTechniqueMeasurement(measured), HasSubstr("; camera+light+merging "));
  EXPECT_FALSE(Measure(Diffuse({1})).merged);
}

// Squared bias counts as error that samples do not reduce, as does the light that others miss.
TEST(TechniqueMeasurementTest, BiasAndVarianceDecideAboutMerging) {
  TechniqueMeasurement measured;
  measured.camera = measured.guided = {50, 1};
  measured.both = {10, 2};
  measured.merged = {2, 3};
  measured.frame_samples = 100;
  const TechniqueSet merging = TechniqueSet::kCameraAndLight.With(Technique::kMerging);
  EXPECT_EQ(measured.Best(), merging);
  EXPECT_DOUBLE_EQ(measured.GainOfMerging(), 20.0 / 6);
  measured.bias_mse = 0.04;
  EXPECT_DOUBLE_EQ(measured.GainOfMerging(), 20.0 / 18);
  EXPECT_EQ(measured.Best(), TechniqueSet::kCameraAndLight);
  measured.missing_mse = measured.unmerged_missing_mse = 1;
  EXPECT_DOUBLE_EQ(measured.GainOfMerging(), 820.0 / 18);
  EXPECT_EQ(measured.Best(), merging);
}

// One pixel with a rare bright sample promises much, and is no evidence.
TEST(TechniqueMeasurementTest, GainsNeedMoreThanOnePixel) {
  TechniqueMeasurement measured;
  const auto cost_of = [](std::vector<double> errors) {
    double sum = 0;
    for (const double error : errors) sum += error;
    const double mean = sum / static_cast<double>(errors.size());
    return TechniqueCost{mean, 1, std::move(errors)};
  };
  std::vector<double> errors(100, 0.9);
  errors.front() = 2400 - 99 * 0.9;
  measured.camera = measured.guided = cost_of(errors);
  measured.both = cost_of(std::vector<double>(100, 1));
  EXPECT_NEAR(measured.Gain(TechniqueSet::kCameraAndLight), 24, 1e-9);
  EXPECT_NEAR(measured.LeastGain(TechniqueSet::kCameraAndLight), 0.9, 1e-9);
  EXPECT_EQ(measured.Best(), TechniqueSet::kCamera);
  measured.camera = measured.guided = cost_of(std::vector<double>(100, 24));
  EXPECT_NEAR(measured.LeastGain(TechniqueSet::kCameraAndLight), 24, 1e-9);
  EXPECT_EQ(measured.Best(), TechniqueSet::kCameraAndLight);
}

TEST(TechniqueMeasurementTest, LargeFramesOfSmallScenesAreMeasuredUnasked) {
  FrameSettings settings = SquareSettings(512, 64, 6);
  EXPECT_TRUE(MayMeasureUnasked(settings, uint64_t{64} << 20));
  EXPECT_FALSE(MayMeasureUnasked(settings, uint64_t{65} << 20));
  settings.samples = 63;
  EXPECT_FALSE(MayMeasureUnasked(settings, 0));
  settings = SquareSettings(512, 64, 6);
  settings.techniques = TechniqueSet::kCameraGuided;
  EXPECT_FALSE(MayMeasureUnasked(settings, 0));
  settings.techniques = TechniqueSet::kCamera;
  settings.similarity_after = 4;
  EXPECT_FALSE(MayMeasureUnasked(settings, 0));
}

// The first look is a hundredth of the smallest frame that is measured unasked.
TEST(TechniqueMeasurementTest, UnaskedLooksAreCheap) {
  TableFileSource files({});
  const FrameSettings settings = SquareSettings(512, 64, 6);
  const auto rays_of = [&](const TestScene& t) {
    const absl::StatusOr<TechniqueMeasurement> measured =
        MeasureTechniques(t.scene, settings, files, TechniqueEffort::kUnasked);
    EXPECT_TRUE(measured.ok()) << measured.status();
    EXPECT_EQ(measured->Best(), TechniqueSet::kCamera) << FormatTechniqueMeasurement(*measured);
    EXPECT_FALSE(measured->guided_both);
    // The training of the guided image is in its cost for the frame, which is a small part.
    const double rays = measured->camera.cost_rays + measured->both.cost_rays +
                        measured->guided.cost_rays +
                        (measured->merged ? measured->merged->cost_rays : 0);
    const auto samples =
        static_cast<double>(measured->samples * measured->width_px * measured->height_px);
    return rays * samples / (measured->camera.cost_rays * FrameSamples(settings));
  };
  EXPECT_LT(rays_of(Diffuse({1})), 0.01);
  EXPECT_LT(rays_of(ManyLights({1})), 0.01);
}

// A frame of plain light pays for the first look alone; another one for images that grow with it.
TEST(TechniqueMeasurementTest, ImagesAreAFractionOfTheFrame) {
  TableFileSource files({});
  const auto measure = [&](const TestScene& t, uint64_t samples) {
    const absl::StatusOr<TechniqueMeasurement> measured =
        MeasureTechniques(t.scene, SquareSettings(128, samples, 6), files, TechniqueEffort::kAsked);
    EXPECT_TRUE(measured.ok()) << measured.status();
    return *measured;
  };
  const auto total = [](const TechniqueMeasurement& measured) {
    return measured.samples * static_cast<uint64_t>(measured.width_px * measured.height_px);
  };
  const TechniqueMeasurement plain = measure(Diffuse({1}), 4096);
  EXPECT_EQ(total(plain), kLookSamplesMax);
  EXPECT_FALSE(plain.guided_both);
  EXPECT_EQ(total(measure(Diffuse({1}), 1)), kPilotSamplesMin);
  EXPECT_THAT(FormatTechniqueMeasurement(plain), testing::Not(HasSubstr("both")));
  const TechniqueMeasurement small = measure(Caustic(0.05f), 1),
                             large = measure(Caustic(0.05f), 64);
  EXPECT_EQ(total(small), kThoroughSamplesMin);
  EXPECT_TRUE(small.guided_both);
  EXPECT_EQ(total(large), 128 * 128 * 64 / kFrameSamplesPerPilotSample);
}

// Images by several techniques of one compiled scene are those of scenes compiled for each.
TEST(TechniqueMeasurementTest, TechniquesChangeWithoutCompiling) {
  const TestScene t = Caustic(0.05f);
  FrameSettings settings = SquareSettings(24, 16, 6);
  TableFileSource files({});
  const absl::StatusOr<ChangeableScenePtr> changeable =
      CompileChangeableScene(t.scene, settings, files);
  ASSERT_TRUE(changeable.ok()) << changeable.status();
  CompiledScene* const changing = changeable->get();
  for (const TechniqueSet techniques :
       {TechniqueSet::kCameraAndLight, TechniqueSet::kCameraGuided, TechniqueSet::kCamera,
        TechniqueSet::kCameraAndLightGuided}) {
    ASSERT_TRUE(SetTechniques(techniques, changing).ok());
    settings.techniques = techniques;
    const CompiledScenePtr compiled = Compile(t.scene, settings);
    EXPECT_EQ(changing->plan.traits, compiled->plan.traits);
    ASSERT_TRUE(EnsureGuiding(*changing, {}).ok());
    ASSERT_TRUE(EnsureGuiding(*compiled, {}).ok());
    EXPECT_TRUE(RenderAll(*changing) == RenderAll(*compiled)) << techniques.Name();
  }
}

TEST(TechniqueMeasurementTest, BlackImageNeedsNoLightPaths) {
  const TechniqueMeasurement measured = Measure(OpenBox({1}));
  EXPECT_EQ(measured.Gain(TechniqueSet::kCameraAndLight), 1);
  EXPECT_EQ(measured.Best(), TechniqueSet::kCamera);
}

}  // namespace
}  // namespace sheaf::render
