// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// many_lights_bench [LIGHTS] [MIN_GAIN]: cost and gain of the light tree. For scenes of a million
// small lights it prints the build time and the size of the tree, then compares irradiance
// estimates that choose lights by the tree, by power only and uniformly, in the time that the tree
// needs for 64 samples per point. Times are measured. Variances are exact sums of f^2 / p over all
// lights, since rare bright samples cause most of the error of bad choices and would make sampled
// variances unreliable. Exits with 1 if the tree's mean squared error is not MIN_GAIN times below
// that of uniform choice in equal time without ray tracing.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "common/math/elementary.h"
#include "tests/bench/measures.h"
#include "worker/render/light/choice/light_tree.h"
#include "worker/render/light/shape_sampling.h"
#include "worker/render/sampling/discrete_distribution.h"
#include "worker/render/sampling/sampler.h"

namespace sheaf::render {
namespace {

constexpr double kSamplesPerPoint = 64;
constexpr int kPointCount = 16;
// For timing: samples per point, and the number of runs of which the fastest counts.
constexpr uint64_t kTimedSamples = 16384;
constexpr int kTimedRuns = 3;
// Assumed time of a sample's ray and material evaluation in a renderer; many scenes take longer.
constexpr double kRaySeconds = 1e-6;

struct Point {
  Vec3f p, n;
};

// A one-sided triangle if it has vertices, otherwise a sphere.
struct Light {
  Vec3f v0, v1, v2;  // The triangle's vertices; v0 is a sphere's center.
  float radius = 0;  // The sphere's radius.
  float radiance = 0;
};

struct Scene {
  std::string name;
  std::vector<Light> lights;
  std::vector<Point> points;
};

LightBounds BoundsOf(const Light& light) {
  if (light.radius > 0) {
    return {.kind = LightBounds::Kind::kSphere,
            .center = light.v0,
            .radius = light.radius,
            .area = static_cast<float>(kPi) * light.radius * light.radius,
            .strength = light.radiance};
  }
  const Vec3f cross = Cross(light.v1 - light.v0, light.v2 - light.v0);
  const Vec3f center = (light.v0 + light.v1 + light.v2) * (1 / 3.0f);
  return {.kind = LightBounds::Kind::kPlanar,
          .two_sided = false,
          .center = center,
          .normal = Normalize(cross),
          .radius = std::max(
              {Length(light.v0 - center), Length(light.v1 - center), Length(light.v2 - center)}),
          .area = 0.5f * Length(cross),
          .strength = light.radiance};
}

double PowerOf(const Light& light) {
  const LightBounds bounds = BoundsOf(light);
  return static_cast<double>(bounds.strength) * static_cast<double>(bounds.area) *
         (light.radius > 0 ? 4 : 1);
}

// One light sample, as the light table draws it: irradiance over the pdf.
double Sample(const Light& light, const Point& point, Vec2f u) {
  ShapePoint on_light;
  double pdf = 0;
  if (light.radius > 0) {
    const Vec3d center = ToDouble(light.v0);
    const SphereView view = ViewSphere(center, static_cast<double>(light.radius), false, point.p);
    if (!view.visible || view.inside) return 0;
    on_light = SampleSphere(view, center, static_cast<double>(light.radius), u);
    pdf = view.pdf;
  } else {
    const TriangleView view = ViewTriangle(light.v0, light.v1, light.v2, point.p);
    if (!view.visible || !view.front()) return 0;
    on_light = SampleTriangle(view, light.v0, point.p, u);
    pdf = PdfTriangle(view, point.p, ToFloat(on_light.p));
  }
  const double cosine = Dot(on_light.wi, ToDouble(point.n));
  return cosine > 0 && pdf > 0 ? static_cast<double>(light.radiance) * cosine / pdf : 0;
}

// First and second moments of a light's samples.
struct Moments {
  double mean = 0, square = 0;
};
// By a midpoint rule; for distant lights a single point suffices.
Moments MomentsOf(const Light& light, const Point& point) {
  const LightBounds bounds = BoundsOf(light);
  const int steps = Length(bounds.center - point.p) > 100 * bounds.radius ? 1 : 8;
  Moments moments;
  for (int i = 0; i < steps * steps; ++i) {
    const float steps_inverse = 1 / static_cast<float>(steps);
    const double value = Sample(light, point,
                                {(static_cast<float>(i % steps) + 0.5f) * steps_inverse,
                                 (static_cast<float>(i / steps) + 0.5f) * steps_inverse});
    moments.mean += value / (steps * steps);
    moments.square += value * value / (steps * steps);
  }
  return moments;
}

class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  float Next() { return static_cast<float>(engine_() >> 40) * 0x1p-24f; }
  float Between(float low, float high) { return low + (high - low) * Next(); }

 private:
  std::mt19937_64 engine_;
};

// Lights over a plain: small spheres of very different radiance slightly above the ground, whose
// size grows with the number of lights.
Scene MakePlain(size_t count) {
  Random random(1);
  const float side = std::sqrt(static_cast<float>(count));
  Scene scene{.name = "plain", .lights = {}, .points = {}};
  for (size_t i = 0; i < count; ++i) {
    const float x = random.Between(0, side), y = random.Between(0, side);
    const float radiance = std::exp(random.Between(-3, 3));
    scene.lights.push_back({.v0 = {x, y, random.Between(0.5f, 2)},
                            .v1 = {},
                            .v2 = {},
                            .radius = 0.05f,
                            .radiance = radiance});
  }
  for (int i = 0; i < kPointCount; ++i) {
    const float x = random.Between(0, side), y = random.Between(0, side);
    scene.points.push_back({{x, y, 0}, {0, 0, 1}});
  }
  return scene;
}

// A room whose ceiling and walls are covered with small one-sided triangles that face random inward
// directions; the points are on the floor and on a column in the middle.
Scene MakeRoom(size_t count) {
  Random random(2);
  Scene scene{.name = "room", .lights = {}, .points = {}};
  const float size = 3 / std::sqrt(static_cast<float>(count));
  for (size_t i = 0; i < count; ++i) {
    // The walls -x, +x, -y, +y and the ceiling of a cube of side 10.
    const auto wall = static_cast<size_t>(random.Next() * 5);
    const size_t axis = wall / 2;
    const float inwards = wall == 4 || wall % 2 == 1 ? -1.0f : 1.0f;
    Vec3f v0{random.Between(-5, 5), random.Between(-5, 5), random.Between(-5, 5)};
    v0[axis] = -5 * inwards;
    const auto direction = [&] {
      return Vec3f{random.Between(-1, 1), random.Between(-1, 1), random.Between(-1, 1)} * size;
    };
    Light light{.v0 = v0, .v1 = v0 + direction(), .v2 = v0 + direction()};
    const Vec3f normal = Cross(light.v1 - light.v0, light.v2 - light.v0);
    if (!(LengthSquared(normal) > 0)) continue;
    if (normal[axis] * inwards < 0) std::swap(light.v1, light.v2);
    light.radiance = std::exp(random.Between(-2, 2));
    scene.lights.push_back(light);
  }
  for (int i = 0; i < kPointCount / 2; ++i) {
    scene.points.push_back(
        {{random.Between(-4.9f, 4.9f), random.Between(-4.9f, 4.9f), -5}, {0, 0, 1}});
    const SinCosPair<float> turn = SinCos(random.Between(0, 6.2831853f));
    scene.points.push_back(
        {{turn.cos, turn.sin, random.Between(-5, 4.9f)}, {turn.cos, turn.sin, 0}});
  }
  return scene;
}

// A method of choosing lights.
struct Method {
  const char* name;
  double variance = 0;            // Relative, per sample; mean over the points.
  double seconds_per_sample = 0;  // CPU time.
};

// Takes samples as a renderer does. Returns the mean over the points, so that the compiler keeps
// the work.
template <typename Choose>
double Estimate(const Scene& scene, const Choose& choose) {
  double sum = 0;
  for (size_t k = 0; k < scene.points.size(); ++k) {
    const Point& point = scene.points[k];
    for (uint64_t i = 0; i < kTimedSamples; ++i) {
      const auto u = Sampler(7, static_cast<int32_t>(k), 0, i).Get4(1);
      const ChosenLight chosen = choose(point, u[0], SaltOf({u[1], u[2]}));
      sum += Sample(scene.lights[chosen.light], point, {u[1], u[2]}) /
             static_cast<double>(chosen.probability);
    }
  }
  return sum / static_cast<double>(kTimedSamples * scene.points.size());
}

template <typename Choose>
void Time(const Scene& scene, const Choose& choose, double expected, Method* method) {
  method->seconds_per_sample = 1e30;
  double mean = 0;
  for (int run = 0; run < kTimedRuns; ++run) {
    const double start = ThreadCpuSeconds();
    mean = Estimate(scene, choose);
    method->seconds_per_sample = std::min(
        method->seconds_per_sample,
        (ThreadCpuSeconds() - start) / static_cast<double>(kTimedSamples * scene.points.size()));
  }
  std::printf("  %-8s %6.0f ns a sample, %10.4g relative variance, estimate / sum %.3f\n",
              method->name, 1e9 * method->seconds_per_sample, method->variance, mean / expected);
}

// Returns the error of uniform choice over that of the tree at equal time.
double Compare(const Scene& scene) {
  std::vector<LightBounds> bounds;
  std::vector<double> powers;
  for (const Light& light : scene.lights) {
    bounds.push_back(BoundsOf(light));
    powers.push_back(PowerOf(light));
  }
  const double start = ThreadCpuSeconds();
  const LightTree tree(bounds);
  const double seconds = ThreadCpuSeconds() - start;
  std::printf("%s: %zu lights, tree built in %.2f s, %.1f bytes a light, depth %d\n",
              scene.name.c_str(), scene.lights.size(), seconds,
              static_cast<double>(tree.size_bytes()) / static_cast<double>(scene.lights.size()),
              tree.depth());
  const DiscreteDistribution by_power(powers);
  const auto count = static_cast<double>(scene.lights.size());
  const auto point_count = static_cast<double>(scene.points.size());
  Method methods[] = {{"tree"}, {"power"}, {"uniform"}};
  double expected = 0;
  for (const Point& point : scene.points) {
    double irradiance = 0, squares[3] = {};
    for (uint32_t i = 0; i < scene.lights.size(); ++i) {
      const Moments moments = MomentsOf(scene.lights[i], point);
      if (!(moments.mean > 0)) continue;
      irradiance += moments.mean;
      squares[0] += moments.square / static_cast<double>(tree.Probability(i, point.p, point.n));
      squares[1] += moments.square / by_power.Probability(i);
      squares[2] += moments.square * count;
    }
    for (int i = 0; i < 3; ++i) {
      methods[i].variance += (squares[i] / (irradiance * irradiance) - 1) / point_count;
    }
    expected += irradiance / point_count;
  }
  const auto choose_by_tree = [&](const Point& point, float u, uint64_t salt) {
    return tree.Choose(point.p, point.n, ExtendBits(u, salt)).value_or(ChosenLight{0, 1});
  };
  const auto choose_by_power = [&](const Point&, float u, uint64_t salt) {
    const size_t light = by_power.Sample(ExtendBits(u, salt));
    return ChosenLight{static_cast<uint32_t>(light),
                       static_cast<float>(by_power.Probability(light))};
  };
  const auto choose_uniformly = [&](const Point&, float u, uint64_t salt) {
    return ChosenLight{static_cast<uint32_t>(ExtendBits(u, salt) * count),
                       static_cast<float>(1 / count)};
  };
  Time(scene, choose_by_tree, expected, &methods[0]);
  Time(scene, choose_by_power, expected, &methods[1]);
  Time(scene, choose_uniformly, expected, &methods[2]);
  double gain = 0;
  for (const Method& method : methods) {
    const double samples =
        kSamplesPerPoint * methods[0].seconds_per_sample / method.seconds_per_sample;
    gain = method.variance * method.seconds_per_sample /
           (methods[0].variance * methods[0].seconds_per_sample);
    const double gain_with_rays =
        method.variance * (method.seconds_per_sample + kRaySeconds) /
        (methods[0].variance * (methods[0].seconds_per_sample + kRaySeconds));
    std::printf(
        "  %-8s in the time of 64 by the tree: %5.0f samples, relative MSE %.3g, %.1f x; "
        "%.1f x where each sample traces a ray in 1 us\n",
        method.name, samples, method.variance / samples, gain, gain_with_rays);
  }
  return gain;
}

int Main(int argc, char** argv) {
  const size_t count = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 1000000;
  const double gain_min = argc > 2 ? std::strtod(argv[2], nullptr) : 0;
  if (count < 1) {
    std::fprintf(stderr, "usage: many_lights_bench [LIGHTS] [MIN_GAIN]\n");
    return 2;
  }
  const double plain = Compare(MakePlain(count)), room = Compare(MakeRoom(count));
  return std::min(plain, room) < gain_min ? 1 : 0;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) { return sheaf::render::Main(argc, argv); }
