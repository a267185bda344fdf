// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests that the weights of the three techniques that find a path sum to 1: random light paths are
// followed again from the camera, vertex by vertex, and all weights computed for the same path. For
// a path that begins in emissive media, they are those of all light along its line.
// With guiding, the camera's densities are those of a field that a training has learned; with
// guided emission, those of lights are.
// Where light paths are merged, the camera sees the paths in a mirror.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "tests/support/emissive_scenes.h"
#include "tests/support/guided_scenes.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/guiding_training.h"
#include "worker/render/integrator/light_path.h"
#include "worker/render/integrator/volume_emission.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

struct Weights {
  double light_path = 0, sampled = 0, hit = 0;
  double Sum() const { return light_path + sampled + hit; }
};

// The path from the lens through points[0], points[1] ... to a light.
struct Path {
  Vec3f p_lens;
  std::vector<Vec3f> points;
  LightEnd light;
  Vec3f arrives_along{};  // The light path, at points[0].
};

template <TraitBits kTraits>
class WeightsTest : public ::testing::Test {
 protected:
  using FromLight =
      IntegratorConfig<kTraits, const EmbreeScene, DirectLight::kByBoth, PathKind::kLight>;
  using FromCamera = IntegratorConfig<kTraits, const EmbreeScene, DirectLight::kByBoth,
                                      PathKind::kCameraBesideLight>;
  static constexpr bool kGuided = Has(kTraits, Trait::kGuiding);
  static constexpr bool kLearnsLights = Has(kTraits, Trait::kLearnedLights);
  static constexpr bool kEmission = Has(kTraits, Trait::kEmissiveMedia);

  void Load(const TestScene& test_scene, bool merges = false) {
    FrameSettings settings = SquareSettings(16, 1, 8);
    settings.techniques =
        kGuided ? TechniqueSet::kCameraAndLightGuided : TechniqueSet::kCameraAndLight;
    if (kLearnsLights) settings.techniques = settings.techniques.With(Technique::kLearnedLights);
    if (FromCamera::kSplitsLights) settings.light_samples = 8;
    if (merges) settings.techniques = settings.techniques.With(Technique::kMerging);
    if (guides_emission_) {
      settings.techniques = settings.techniques.With(sheaf::Technique::kEmissionGuiding);
    }
    compiled_ = Compile(
        test_scene.scene, settings,
        guides_emission_ ? CompileTechniques{.training_paths_first = 16384} : kSmallTraining);
    ASSERT_TRUE(EnsureGuiding(*compiled_, {}).ok());
    if (guides_emission_) {
      ASSERT_GT(compiled_->guiding->fields()->emission.cell_count(), 1u);
    }
  }
  template <typename C>
  Context<C> ContextOf(const Sampler& sampler, LightGroups<Rgb>& groups) {
    Context<C> context{*compiled_, *compiled_->tracer, sampler, counts_, nullptr, groups, {}, {}};
    const LearnedFields* fields = compiled_->guiding ? compiled_->guiding->fields() : nullptr;
    context.emission = EmissionBy<C>(*compiled_, fields);
    if constexpr (C::kKnowsLights) context.guiding.fields = compiled_->guiding->fields();
    return context;
  }
  // The weights of all random paths of the scenes, of `light_paths` light paths each.
  void ExpectSumsOfOne(const std::vector<TestScene>& scenes, uint64_t light_paths = 2'000);

  // The same, seen in a mirror.
  void ExpectSumsOfOneInMirror(const std::vector<TestScene>& scenes);

  // The camera's weights for the path; none where rounding or a cut-off leads elsewhere.
  std::optional<Weights> FromTheCamera(const Path& path);
  // All weights for the path, which the camera sees in the mirror; none where it does not.
  std::optional<Weights> InTheMirror(const Path& path);
  // Follows the path from its first point on, at which it has arrived.
  std::optional<Weights> FollowFrom(const Context<FromCamera>& c, const Path& followed,
                                    SurfaceVertex<FromCamera>* at, PathState<FromCamera>* path);
  // Those at the last vertex, towards its light.
  Weights WeightsAt(const Context<FromCamera>& c, const SurfaceVertex<FromCamera>& at, Vec3f wi,
                    const LightEnd& end, PathState<FromCamera>* path);
  // The next vertex behind all null interfaces.
  template <typename C>
  static SurfaceVertex<C>* NextSurface(const Context<C>& c, PathState<C>* path, Vertex<C>* vertex);
  // Every path of the light path that the sampler names that is rough at all vertices.
  void AddPaths(uint64_t index, std::vector<std::pair<Path, double>>* paths);

  bool guides_emission_ = false;
  CompiledScenePtr compiled_;
  RayCounts counts_;
};

template <TraitBits kTraits>
template <typename C>
SurfaceVertex<C>* WeightsTest<kTraits>::NextSurface(const Context<C>& c, PathState<C>* path,
                                                    Vertex<C>* vertex) {
  for (;;) {
    NextVertex(c, path, vertex);
    const auto* passed = std::get_if<NullInterface>(vertex);
    if (passed == nullptr) return std::get_if<SurfaceVertex<C>>(vertex);
    if (!CrossNullInterface(c, passed->point, path)) return nullptr;
  }
}

template <TraitBits kTraits>
void WeightsTest<kTraits>::AddPaths(uint64_t index, std::vector<std::pair<Path, double>>* paths) {
  const Sampler sampler(7, 0, 0, index);
  LightGroups<Rgb> groups;
  const Context<FromLight> c = ContextOf<FromLight>(sampler, groups);
  PathState<FromLight> path;
  if (!StartAtLight(c, &path)) return;
  std::vector<Vec3f> points;
  FilmSample unused;
  Vertex<FromLight> vertex;
  for (;;) {
    auto* at = NextSurface(c, &path, &vertex);
    if (at == nullptr || !at->Arrive(c, &path, &unused) || at->bsdf.specular) return;
    if (path.other_end.is_first && !ArriveFirst(c, *at, true, &path)) return;
    points.insert(points.begin(), at->point.p);
    const auto seen = compiled_->camera.SampleWi(at->point.p, {}, 0);
    if (seen) {
      const BsdfValue value = at->SeenFrom(c, seen->wi).Eval(-path.ray.d);
      double line = 0;
      const Rgb transmittance = TransmittanceToLens(c, *at, *seen, {}, path, &line);
      if (!value.f_cos.IsBlack() && !transmittance.IsBlack()) {
        const double camera_paths = CameraPathsAtLens(
            c, static_cast<double>(value.pdf), static_cast<double>(at->FluxFactor(seen->wi, path)),
            seen->ray_density, path);
        const float weight = ConnectionWeight(c, camera_paths);
        paths->push_back({{seen->p_lens, points, path.other_end, Normalize(path.ray.d)},
                          static_cast<double>(weight)});
      }
    }
    if (!at->ScatterFromLight(c, &path) || path.specular) return;
  }
}

template <TraitBits kTraits>
Weights WeightsTest<kTraits>::WeightsAt(const Context<FromCamera>& c,
                                        const SurfaceVertex<FromCamera>& at, Vec3f wi,
                                        const LightEnd& end, PathState<FromCamera>* path) {
  const float pdf = at.Eval(wi).pdf;
  const auto scatter = [&] {
    NoteScattering(c, at, wi, pdf, 0, 1, path);
    path->specular = false;
    path->pdf = pdf;
    path->from = at.point.p;
    path->ray.d = wi;
  };
  Weights weights;
  if constexpr (kEmission) {
    if (end.is_medium) {
      const double sampled = MediaPdf(c, at.point.p, wi);
      if (sampled > 0) {
        weights.sampled =
            static_cast<double>(MediaSampleWeightBesideLight(c, at, wi, sampled, pdf, *path));
      }
      scatter();
      weights.hit = static_cast<double>(EmissionHitWeight(c, *path));
      return weights;
    }
  }
  LightSample light;
  light.wi = wi;
  light.p_light = end.p;
  light.n_light = end.n;
  light.light = end.light;
  light.is_delta = !end.can_be_hit;
  light.pdf = light.is_delta
                  ? compiled_->lights->choice().Probability(end.light, at.point.p, at.light_hint,
                                                            QueryFor<kTraits>(at.Query()))
                  : compiled_->lights->PdfEmitter<kTraits>(end.light, at.point.p, at.light_hint, wi,
                                                           end.p, at.Query());
  weights.sampled = static_cast<double>(at.LightSampleWeight(c, light, pdf, *path));
  if (end.can_be_hit) {
    scatter();
    const double emitted = c.emission.DensityAt(end.light, at.point.p, end.p, end.n, -wi);
    weights.hit = static_cast<double>(HitWeight(c, static_cast<double>(light.pdf), emitted, *path));
  }
  return weights;
}

template <TraitBits kTraits>
std::optional<Weights> WeightsTest<kTraits>::FromTheCamera(const Path& followed) {
  const Sampler sampler(8, 0, 0, 0);
  LightGroups<Rgb> groups;
  const Context<FromCamera> c = ContextOf<FromCamera>(sampler, groups);
  PathState<FromCamera> path;
  path.ray.o = path.camera_o = followed.p_lens;
  path.ray.d = Normalize(followed.points[0] - followed.p_lens);
  if constexpr (FromCamera::kMedia) StartInMedia(c, &path);
  Vertex<FromCamera> vertex;
  return FollowFrom(c, followed, NextSurface(c, &path, &vertex), &path);
}

template <TraitBits kTraits>
std::optional<Weights> WeightsTest<kTraits>::FollowFrom(const Context<FromCamera>& c,
                                                        const Path& followed,
                                                        SurfaceVertex<FromCamera>* at,
                                                        PathState<FromCamera>* path) {
  FilmSample unused;
  Vertex<FromCamera> vertex;
  for (size_t i = 0; i < followed.points.size(); ++i) {
    if (i > 0) at = NextSurface(c, path, &vertex);
    const float near = 1e-4f * Length(followed.points[i]);
    if (at == nullptr || Length(at->point.p - followed.points[i]) > near) return std::nullopt;
    if (!at->Arrive(c, path, &unused)) return std::nullopt;
    const bool is_last = i + 1 == followed.points.size();
    const Vec3f target = is_last ? followed.light.p : followed.points[i + 1];
    const Vec3f wi = Normalize(target - at->point.p);
    if (is_last) return WeightsAt(c, *at, wi, followed.light, path);
    NoteScattering(c, *at, wi, at->Eval(wi).pdf, 0, 1, path);
    path->specular = false;
    Leave(at->point, wi, &path->ray);
    path->ray.d = wi;
  }
  return std::nullopt;
}

// The mirror of AddMirror.
constexpr double kMirrorX = 1.8;

template <TraitBits kTraits>
std::optional<Weights> WeightsTest<kTraits>::InTheMirror(const Path& followed) {
  const Sampler sampler(9, 0, 0, 0);
  LightGroups<Rgb> groups;
  const Context<FromCamera> c = ContextOf<FromCamera>(sampler, groups);
  PathState<FromCamera> path;
  path.ray.o = path.camera_o = followed.p_lens;
  const auto x = static_cast<float>(kMirrorX - compiled_->geometry.render_origin_world.x);
  Vec3f image = followed.points[0];
  image.x = 2 * x - image.x;
  path.ray.d = Normalize(image - followed.p_lens);
  if constexpr (FromCamera::kMedia) StartInMedia(c, &path);
  FilmSample unused;
  Vertex<FromCamera> vertex;
  SurfaceVertex<FromCamera>* at = NextSurface(c, &path, &vertex);
  if (at == nullptr || !at->bsdf.specular || !at->Arrive(c, &path, &unused)) return std::nullopt;
  EXPECT_EQ(path.other_end.merge_radius, 0);
  if (!at->Scatter(c, &path)) return std::nullopt;
  at = NextSurface(c, &path, &vertex);
  if (at == nullptr) return std::nullopt;
  SurfaceVertex<FromCamera> first = *at;
  std::optional<Weights> weights = FollowFrom(c, followed, &first, &path);
  // Rough glass is left to camera paths.
  if (!weights || !(path.other_end.merge_radius > 0)) return std::nullopt;
  // The weight of a light path that is merged there.
  const Context<FromLight> of_light = ContextOf<FromLight>(sampler, groups);
  PathState<FromLight> arrived;
  arrived.other_end = followed.light;
  arrived.depth = static_cast<uint32_t>(followed.points.size());
  GatherPointOf<Rgb> stored;
  first.Store(&stored);
  const SurfaceVertex<FromLight> seen(of_light, first.point.p, stored);
  const Vec3f d = followed.arrives_along;
  const double cosine = std::fabs(static_cast<double>(Dot(d, stored.ng)));
  weights->light_path = static_cast<double>(ConnectionWeight(
      of_light,
      CameraPathsAtMerge(of_light, static_cast<double>(seen.Eval(-d).pdf),
                         path.other_end.merge_radius, cosine, /*camera_vertices=*/2, arrived)));
  return weights;
}

template <TraitBits kTraits>
void WeightsTest<kTraits>::ExpectSumsOfOneInMirror(const std::vector<TestScene>& scenes) {
  int compared = 0, longest = 0, merged = 0, off = 0;
  for (const TestScene& scene : scenes) {
    Load(scene, /*merges=*/true);
    std::vector<std::pair<Path, double>> paths;
    for (uint64_t i = 0; i < 4'000; ++i) AddPaths(i, &paths);
    for (const auto& path : paths) {
      const std::optional<Weights> weights = InTheMirror(path.first);
      if (!weights) continue;
      ++compared;
      longest = std::max(longest, static_cast<int>(path.first.points.size()));
      merged += weights->light_path > 0.1;
      if (std::fabs(weights->Sum() - 1) <= 2e-4) continue;
      ++off;
      EXPECT_TRUE(kGuided || kLearnsLights)
          << path.first.points.size() << " vertices: " << weights->light_path << " + "
          << weights->sampled << " + " << weights->hit;
    }
  }
  std::printf("%d paths in the mirror, %d by merging, up to %d vertices, %d off\n", compared,
              merged, longest, off);
  EXPECT_LE(off, kGuided || kLearnsLights ? compared / 100 : 0);
  EXPECT_GT(compared, 1'000);
  EXPECT_GT(merged, compared / 20);
  EXPECT_GE(longest, 3);
}

template <TraitBits kTraits>
void WeightsTest<kTraits>::ExpectSumsOfOne(const std::vector<TestScene>& scenes,
                                           uint64_t light_paths) {
  int compared = 0, followed = 0, longest = 0, off = 0, from_media = 0;
  for (const TestScene& scene : scenes) {
    Load(scene);
    std::vector<std::pair<Path, double>> paths;
    for (uint64_t i = 0; i < light_paths; ++i) AddPaths(i, &paths);
    for (const auto& [path, light_path] : paths) {
      ++followed;
      std::optional<Weights> weights = FromTheCamera(path);
      if (!weights) continue;
      ++compared;
      from_media += path.light.is_medium;
      longest = std::max(longest, static_cast<int>(path.points.size()));
      weights->light_path = light_path;
      if (std::fabs(weights->Sum() - 1) <= 2e-4) continue;
      ++off;
      EXPECT_TRUE(kGuided || kLearnsLights || kEmission || guides_emission_)
          << path.points.size() << " vertices: " << weights->light_path << " + " << weights->sampled
          << " + " << weights->hit;
    }
  }
  std::printf("%d of %d paths compared, %d from media, up to %d vertices, %d off\n", compared,
              followed, from_media, longest, off);
  // The two ends of a path round its points and directions differently, and at the border of two
  // regions, or of two quads, the field's density jumps; so does that of lines through the edges of
  // cells.
  EXPECT_LE(off, kGuided || kLearnsLights || guides_emission_ ? compared / 100
                 : kEmission                                  ? compared / 1000
                                                              : 0);
  EXPECT_GE(from_media, kEmission ? compared / 4 : 0);
  EXPECT_GT(compared, 5'000);
  EXPECT_GT(compared, followed * 0.95);
  EXPECT_GE(longest, 5);
}

// Lights with and without size, rough surfaces that reflect and transmit.
std::vector<TestScene> RoughScenes() {
  TestScene lamp = Diffuse({1});
  PointLight point;
  point.intensity.rgb = {2, 1, 1};
  point.from = {1, 1.4f, -0.5f};
  lamp.scene.lights.push_back({point, {}, {}, {}});
  return {lamp, Glossy({1}), LitRoom(1)};
}

// The same beside a mirror that the camera sees.
std::vector<TestScene> MirroredScenes() {
  std::vector<TestScene> scenes{Diffuse({1}), Glossy({1})};
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = Rgb::Gray(1);
  constexpr auto kX = static_cast<float>(kMirrorX);
  for (TestScene& t : scenes) {
    t.AddShape(
        MeshShape{t.Quad({kX, 0.02f, -3}, {kX, 0.02f, 1.9f}, {kX, 2.9f, 1.9f}, {kX, 2.9f, -3})},
        t.AddMaterial(mirror));
  }
  return scenes;
}

constexpr TraitBits kPlainTraits = CommonTraits(false, false, false, false);
using LightPathWeightsTest = WeightsTest<kPlainTraits>;
using GuidedPathWeightsTest = WeightsTest<Guided(kPlainTraits)>;
using LearnedLightsWeightsTest = WeightsTest<LearnedLights(kPlainTraits)>;
using SplitWeightsTest = WeightsTest<LightSplit(kPlainTraits)>;
using GasWeightsTest = WeightsTest<kColoredMediaTraits>;
using FlameWeightsTest = WeightsTest<kCloudTraits>;

TEST_F(LightPathWeightsTest, SumToOneOnRandomPaths) { ExpectSumsOfOne(RoughScenes()); }
TEST_F(GuidedPathWeightsTest, SumToOneOnRandomPaths) { ExpectSumsOfOne(RoughScenes()); }
TEST_F(LearnedLightsWeightsTest, SumToOneOnRandomPaths) { ExpectSumsOfOne(RoughScenes()); }
TEST_F(LightPathWeightsTest, SumToOneWhereLightPathsAreMerged) {
  ExpectSumsOfOneInMirror(MirroredScenes());
}
TEST_F(SplitWeightsTest, SumToOneOnRandomPaths) { ExpectSumsOfOne(RoughScenes()); }
TEST_F(SplitWeightsTest, SumToOneWhereLightPathsAreMerged) {
  ExpectSumsOfOneInMirror(MirroredScenes());
}
TEST_F(GuidedPathWeightsTest, SumToOneWhereLightPathsAreMerged) {
  ExpectSumsOfOneInMirror(MirroredScenes());
}
TEST_F(LightPathWeightsTest, SumToOneWhereEmissionIsGuided) {
  guides_emission_ = true;
  ExpectSumsOfOne(RoughScenes());
}
TEST_F(GuidedPathWeightsTest, SumToOneWhereEmissionIsGuidedToo) {
  guides_emission_ = true;
  ExpectSumsOfOne(RoughScenes());
}
TEST_F(FlameWeightsTest, SumToOneWhereEmissionIsGuided) {
  guides_emission_ = true;
  ExpectSumsOfOne({RoomWithFlame()}, 5'000);
}
TEST_F(GasWeightsTest, SumToOneOnRandomPaths) { ExpectSumsOfOne({SmokelessRoom()}, 5'000); }
TEST_F(FlameWeightsTest, SumToOneOnRandomPaths) { ExpectSumsOfOne({RoomWithFlame()}, 5'000); }

}  // namespace
}  // namespace sheaf::render
