// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The textures of pattern_textures.h at a point.
//
// Nothing is filtered: a pixel's samples average over its footprint. pbrt-v4 drops the octaves that
// are finer than a pixel; that keeps the mean of a sum of octaves, and changes that of anything
// that is not linear in it, such as marble.
#include <algorithm>
#include <array>
#include <cmath>

#include "common/math/elementary.h"
#include "common/math/perlin_noise.h"
#include "worker/render/material/material.h"
#include "worker/render/material/node_textures.h"
#include "worker/render/material/texture_program.h"

namespace sheaf::render {
namespace {

// Source of the numbers of all patterns: pbrt-v4, textures.h and textures.cpp.
constexpr double kWindRoughness = 0.5, kWindScale = 0.1;
constexpr int kWindOctaves = 3, kWaveOctaves = 6;

constexpr double kDotRadius = 0.35, kDotShiftMax = 0.5 - kDotRadius;

constexpr std::array<Rgb, 9> kMarbleColors = {{{.58f, .58f, .6f},
                                               {.58f, .58f, .6f},
                                               {.58f, .58f, .6f},
                                               {.5f, .5f, .5f},
                                               {.6f, .59f, .58f},
                                               {.58f, .58f, .6f},
                                               {.58f, .58f, .6f},
                                               {.2f, .2f, .33f},
                                               {.58f, .58f, .6f}}};
constexpr float kMarbleBrightness = 1.5f;

double PlaneNoise(double s, double t) { return PerlinNoise({s, t, 0.5}); }

}  // namespace

Vec3d TextureProgram::PointOf(const Node& node, const TexturePoint& point) const {
  const Mapping& m = mappings_[static_cast<size_t>(node.mapping_index)];
  if (node.kind != Kind::kNode || !NodeOf(node).from_uv) return m.PointInTexture(point.p_world);
  return m.PointInTexture({static_cast<double>(point.uv.x) + point.uv_shift.x,
                           static_cast<double>(point.uv.y) + point.uv_shift.y, 0});
}

Rgb TextureProgram::RampAt(const RampTexture& ramp, float input, bool is_color) {
  const auto value_of = [&](const RampTexture::Stop& stop) {
    return is_color ? stop.color : Rgb::Gray(stop.value);
  };
  const auto next =
      std::upper_bound(ramp.stops.begin(), ramp.stops.end(), input,
                       [](float x, const RampTexture::Stop& stop) { return x < stop.position; });
  if (next == ramp.stops.begin()) return value_of(ramp.stops.front());
  const RampTexture::Stop& last = *(next - 1);
  if (next == ramp.stops.end() || ramp.is_stepped) return value_of(last);
  const float t = (input - last.position) / (next->position - last.position);
  return value_of(last) * (1 - t) + value_of(*next) * t;
}

float TextureProgram::NoiseAt(const Node& node, const TexturePoint& point) const {
  const Vec3d p = PointOf(node, point);
  const Pattern& pattern = PatternOf(node);
  switch (pattern.noise) {
    case NoiseTexture::Kind::kFbm:
      return static_cast<float>(FractalNoise(p, pattern.octaves, pattern.roughness));
    case NoiseTexture::Kind::kWrinkled:
      return static_cast<float>(TurbulentNoise(p, pattern.octaves, pattern.roughness));
    case NoiseTexture::Kind::kWindy: {
      const double wind = FractalNoise(kWindScale * p, kWindOctaves, kWindRoughness);
      return static_cast<float>(std::fabs(wind) * FractalNoise(p, kWaveOctaves, kWindRoughness));
    }
  }
  return 0;
}

Rgb TextureProgram::MarbleAt(const Node& node, const TexturePoint& point) const {
  const Pattern& pattern = PatternOf(node);
  const Vec3d p = pattern.scale * PointOf(node, point);
  const double phase =
      p.y + pattern.variation * FractalNoise(p, pattern.octaves, pattern.roughness);
  const double sine = std::isfinite(phase) ? Sin(phase) : 0;
  constexpr auto kSegments = static_cast<int>(kMarbleColors.size()) - 3;
  const double along = std::clamp(0.5 + 0.5 * sine, 0.0, 1.0) * kSegments;
  const int first = std::min(static_cast<int>(along), kSegments - 1);
  const auto t = static_cast<float>(along - first);
  // A cubic Bezier curve with four colors as control points, by de Casteljau's algorithm.
  std::array<Rgb, 4> c;
  std::copy_n(kMarbleColors.begin() + first, 4, c.begin());
  for (size_t left = 3; left > 0; --left) {
    for (size_t i = 0; i < left; ++i) c[i] = c[i] * (1 - t) + c[i + 1] * t;
  }
  return c[0] * kMarbleBrightness;
}

bool TextureProgram::IsInDot(const Node& node, const TexturePoint& point) const {
  const Vec2d st = MapTo2d(node, point);
  if (!std::isfinite(st.x) || !std::isfinite(st.y)) return false;
  const double s = std::floor(st.x + 0.5), t = std::floor(st.y + 0.5);
  if (PlaneNoise(s + 0.5, t + 0.5) <= 0) return false;
  const double ds = st.x - (s + kDotShiftMax * PlaneNoise(s + 1.5, t + 2.8));
  const double dt = st.y - (t + kDotShiftMax * PlaneNoise(s + 4.5, t + 9.8));
  return ds * ds + dt * dt < kDotRadius * kDotRadius;
}

float TextureProgram::ShareAlong(const Node& node, const TexturePoint& point) const {
  return std::min(1.0f, std::fabs(Dot(point.ng, PatternOf(node).direction)));
}

TextureProgram::CornerWeights TextureProgram::CornersAt(const Node& node,
                                                        const TexturePoint& point) const {
  const Vec2d st = MapTo2d(node, point);
  const auto s = static_cast<float>(st.x), t = static_cast<float>(st.y);
  return {{(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t}};
}

double TextureProgram::FinestCell(const Node& node) const {
  const Mapping& m = mappings_[static_cast<size_t>(node.mapping_index)];
  double frequency = 0;
  for (const Vec3d& row : m.rows) frequency = std::fmax(frequency, Length(row));
  if (node.kind == Kind::kNode) return 1 / (frequency * NodeFrequency(NodeOf(node)));
  const Pattern& pattern = PatternOf(node);
  const int octaves = pattern.noise == NoiseTexture::Kind::kWindy ? kWaveOctaves : pattern.octaves;
  for (int i = 1; i < octaves; ++i) frequency *= kLacunarity;
  return 1 / frequency;
}

Vec2d TextureProgram::FinestUvCell(const Node& node) const {
  const Mapping& m = mappings_[static_cast<size_t>(node.mapping_index)];
  const double frequency = NodeFrequency(NodeOf(node));
  const auto width = [&](size_t axis) {
    return 1 / (frequency * Length(Vec3d{m.rows[0][axis], m.rows[1][axis], m.rows[2][axis]}));
  };
  return {width(0), width(1)};
}

}  // namespace sheaf::render
