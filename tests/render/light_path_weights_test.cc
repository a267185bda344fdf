// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests that the weights of the three techniques that find a path sum to 1: random light paths are
// followed again from the camera, vertex by vertex, and all weights computed for the same path.
// With guiding, the camera's densities are those of a field that a training has learned.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "tests/support/guided_scenes.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/guiding_training.h"
#include "worker/render/integrator/light_path.h"
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
};

template <uint32_t kTraits>
class WeightsTest : public ::testing::Test {
 protected:
  using FromLight =
      IntegratorConfig<kTraits, const EmbreeScene, DirectLight::kByBoth, PathKind::kLight>;
  using FromCamera = IntegratorConfig<kTraits, const EmbreeScene, DirectLight::kByBoth,
                                      PathKind::kCameraBesideLight>;
  static constexpr bool kGuided = Has(kTraits, Trait::kGuiding);

  void Load(const TestScene& test_scene) {
    FrameSettings settings = SquareSettings(16, 1, 8);
    settings.techniques = kGuided ? Techniques::kCameraAndLightGuided : Techniques::kCameraAndLight;
    compiled_ = Compile(test_scene.scene, settings, kSmallTraining);
    ASSERT_TRUE(EnsureGuiding(*compiled_, {}).ok());
  }
  template <typename C>
  Context<C> ContextOf(const Sampler& sampler, LightGroups<Rgb>& groups) {
    Context<C> context{*compiled_, *compiled_->tracer, sampler, counts_, nullptr, groups, {}};
    if constexpr (kGuided) context.guiding.fields = compiled_->guiding->fields();
    return context;
  }
  // The weights of all random paths of the scenes.
  void ExpectSumsOfOne(const std::vector<TestScene>& scenes);

  // The camera's weights for the path; none where rounding or a cut-off leads elsewhere.
  std::optional<Weights> FromTheCamera(const Path& path);
  // Every path of the light path that the sampler names that is rough at all vertices.
  void AddPaths(uint64_t index, std::vector<std::pair<Path, double>>* paths);

  CompiledScenePtr compiled_;
  RayCounts counts_;
};

template <uint32_t kTraits>
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
    NextVertex(c, &path, &vertex);
    auto* at = std::get_if<SurfaceVertex<FromLight>>(&vertex);
    if (at == nullptr || !at->Arrive(c, &path, &unused) || at->bsdf.specular) return;
    if (path.other_end.is_first && !ArriveFirst(c, *at, true, &path)) return;
    points.insert(points.begin(), at->point.p);
    const auto seen = compiled_->camera.SampleWi(at->point.p, {}, 0);
    if (seen) {
      const BsdfValue value = at->SeenFrom(c, seen->wi).Eval(-path.ray.d);
      const Rgb transmittance = TransmittanceToLens(c, *at, *seen, {}, path);
      if (!value.f_cos.IsBlack() && !transmittance.IsBlack()) {
        const float weight = ConnectionWeight(
            c, CameraPathsAtLens(c, static_cast<double>(value.pdf), seen->ray_density, path));
        paths->push_back({{seen->p_lens, points, path.other_end}, static_cast<double>(weight)});
      }
    }
    if (!at->ScatterFromLight(c, &path) || path.specular) return;
  }
}

template <uint32_t kTraits>
std::optional<Weights> WeightsTest<kTraits>::FromTheCamera(const Path& followed) {
  const Sampler sampler(8, 0, 0, 0);
  LightGroups<Rgb> groups;
  const Context<FromCamera> c = ContextOf<FromCamera>(sampler, groups);
  const LightEmission& emission = *compiled_->emission;
  PathState<FromCamera> path;
  path.ray.o = path.camera_o = followed.p_lens;
  path.ray.d = Normalize(followed.points[0] - followed.p_lens);
  FilmSample unused;
  Vertex<FromCamera> vertex;
  for (size_t i = 0; i < followed.points.size(); ++i) {
    NextVertex(c, &path, &vertex);
    auto* at = std::get_if<SurfaceVertex<FromCamera>>(&vertex);
    const float near = 1e-4f * Length(followed.points[i]);
    if (at == nullptr || Length(at->point.p - followed.points[i]) > near) return std::nullopt;
    if (!at->Arrive(c, &path, &unused)) return std::nullopt;
    const bool is_last = i + 1 == followed.points.size();
    const Vec3f target = is_last ? followed.light.p : followed.points[i + 1];
    const Vec3f wi = Normalize(target - at->point.p);
    const float pdf = at->Eval(wi).pdf;
    if (!is_last) {
      NoteScattering(c, *at, wi, pdf, 0, &path);
      path.specular = false;
      path.ray.o = OffsetRayOrigin(at->point.p, at->point.p_error, at->point.ng, wi);
      path.ray.d = wi;
      path.ray.source = at->point.id;
      continue;
    }
    const LightEnd& end = followed.light;
    LightSample light;
    light.wi = wi;
    light.p_light = end.p;
    light.n_light = end.n;
    light.light = end.light;
    light.is_delta = !end.can_be_hit;
    light.pdf = light.is_delta
                    ? compiled_->lights->ChoiceProbability(end.light, at->point.p, at->light_hint,
                                                           at->guided.lights())
                    : compiled_->lights->PdfEmitter<kTraits>(end.light, at->point.p, at->light_hint,
                                                             wi, end.p, at->guided.lights());
    Weights weights;
    weights.sampled = static_cast<double>(at->LightSampleWeight(c, light, pdf, path));
    if (end.can_be_hit) {
      NoteScattering(c, *at, wi, pdf, 0, &path);
      path.specular = false;
      path.pdf = pdf;
      const double emitted = emission.DensityAt(end.light, at->point.p, end.p, end.n, -wi);
      weights.hit =
          static_cast<double>(HitWeight(c, static_cast<double>(light.pdf), emitted, path));
    }
    return weights;
  }
  return std::nullopt;
}

template <uint32_t kTraits>
void WeightsTest<kTraits>::ExpectSumsOfOne(const std::vector<TestScene>& scenes) {
  int compared = 0, followed = 0, longest = 0, off = 0;
  for (const TestScene& scene : scenes) {
    Load(scene);
    std::vector<std::pair<Path, double>> paths;
    for (uint64_t i = 0; i < 2'000; ++i) AddPaths(i, &paths);
    for (const auto& [path, light_path] : paths) {
      ++followed;
      std::optional<Weights> weights = FromTheCamera(path);
      if (!weights) continue;
      ++compared;
      longest = std::max(longest, static_cast<int>(path.points.size()));
      weights->light_path = light_path;
      if (std::fabs(weights->Sum() - 1) <= 2e-4) continue;
      ++off;
      EXPECT_TRUE(kGuided) << path.points.size() << " vertices: " << weights->light_path << " + "
                           << weights->sampled << " + " << weights->hit;
    }
  }
  std::printf("%d of %d paths compared, up to %d vertices, %d off\n", compared, followed, longest,
              off);
  // The two ends of a path round its points and directions differently, and at the border of two
  // regions, or of two quads, the field's density jumps.
  EXPECT_LE(off, kGuided ? compared / 100 : 0);
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

constexpr uint32_t kPlainTraits = CommonTraits(false, false, false, false);
using LightPathWeightsTest = WeightsTest<kPlainTraits>;
using GuidedPathWeightsTest = WeightsTest<Guided(kPlainTraits)>;

TEST_F(LightPathWeightsTest, SumToOneOnRandomPaths) { ExpectSumsOfOne(RoughScenes()); }
TEST_F(GuidedPathWeightsTest, SumToOneOnRandomPaths) { ExpectSumsOfOne(RoughScenes()); }

}  // namespace
}  // namespace sheaf::render
