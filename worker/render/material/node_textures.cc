// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/node_textures.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/math/elementary.h"
#include "common/math/lattice_noise.h"
#include "common/scene/node_parameters.h"
#include "worker/render/material/node_place.h"
#include "worker/render/material/node_voronoi.h"

namespace sheaf::render {
namespace {

using namespace node_number;  // NOLINT: the names of this one table.

Vec3d Finite(Vec3d p) {
  for (int i = 0; i < 3; ++i) p[i] = std::isfinite(p[i]) ? p[i] : 0;
  return p;
}
double Smooth(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// --- Noise -------------------------------------------------------------------------------------

double NoiseOf(const NodePlace& q) {
  switch (q.dimensions) {
    case 1:
      return LatticeNoise(q.w);
    case 2:
      return LatticeNoise(Vec2d{q.p.x, q.p.y});
    case 4:
      return LatticeNoise(q.p, q.w);
    default:
      return LatticeNoise(q.p);
  }
}

struct Octaves {
  double detail, roughness, lacunarity;
};
// A fractional detail mixes the sums of both whole numbers of octaves. normalized: divided by the
// amplitudes' sum, otherwise as it is.
double SumOctaves(const NodePlace& p, const Octaves& o, bool normalized) {
  double sum = 0, amplitude = 1, amplitudes = 0, frequency = 1;
  const int whole = static_cast<int>(o.detail);
  const double part = o.detail - whole;
  for (int i = 0; i <= whole; ++i) {
    sum += amplitude * NoiseOf(frequency * p);
    amplitudes += amplitude;
    amplitude *= o.roughness;
    frequency *= o.lacunarity;
  }
  const auto value = [&](double s, double a) { return normalized ? s / a : s; };
  const double first = value(sum, amplitudes);
  if (part == 0) return first;
  const double more = sum + amplitude * NoiseOf(frequency * p);
  return (1 - part) * first + part * value(more, amplitudes + amplitude);
}

// The noises of several outputs are apart by a shift between 100 and 200 along each axis.
NodePlace ShiftOf(float seed, int dimensions) {
  const auto along = [seed](float axis) {
    return 100 + 100.0 * static_cast<double>(RandomOf(seed, axis));
  };
  if (dimensions == 1) return {{}, 100 + 100.0 * static_cast<double>(RandomOf(seed)), 1};
  return {{along(0), along(1), along(2)}, along(3), dimensions};
}

enum FractalType { kFbm, kMultifractal, kHybrid, kRidged, kHetero };
struct Fractal {
  int type;
  double octaves, fall, lacunarity, offset, gain;  // fall: of the amplitude, from octave to octave.
  bool weighs_part = false;  // Whether what is above the whole octaves of a hybrid has its weight.
};

// The weight of octave i: all of those below the count, a part of the next one.
double WeightOf(const Fractal& f, int i) {
  const int whole = static_cast<int>(f.octaves);
  return i < whole ? 1 : f.octaves - whole;
}

double SumOrProduct(const Fractal& f, NodePlace p) {
  double value = f.type == kFbm ? 0 : 1, power = 1;
  for (int i = 0; i <= static_cast<int>(f.octaves) && WeightOf(f, i) > 0; ++i) {
    const double octave = WeightOf(f, i) * power * NoiseOf(p);
    value = f.type == kFbm ? value + octave : value * (octave + 1);
    power *= f.fall;
    p = f.lacunarity * p;
  }
  return value;
}

double FractalAt(const Fractal& f, NodePlace p) {
  if (f.type == kFbm || f.type == kMultifractal) return SumOrProduct(f, p);
  const int whole = static_cast<int>(f.octaves);
  const double first = NoiseOf(p);
  double signal = f.offset - std::fabs(first);
  signal *= signal;
  double value = f.type == kRidged ? signal : first + f.offset;
  double weight = f.gain * value, power = f.fall;
  for (int i = 1; i <= whole; ++i) {
    p = f.lacunarity * p;
    // Ridges have no octave in part.
    if (WeightOf(f, i) == 0 || (f.type == kRidged && i == whole)) break;
    const double noise = NoiseOf(p);
    if (f.type == kHetero) {
      value += WeightOf(f, i) * (noise + f.offset) * power * value;
    } else if (f.type == kHybrid) {
      const double octave = (noise + f.offset) * power;
      if (i == whole && !f.weighs_part) {
        value += WeightOf(f, i) * octave;
      } else if (weight > 0.001) {
        weight = std::fmin(weight, 1);
        value += WeightOf(f, i) * weight * octave;
        weight *= f.gain * octave;
      }
    } else {
      const double share = std::clamp(signal * f.gain, 0.0, 1.0);
      signal = f.offset - std::fabs(noise);
      signal *= signal * share;
      value += signal * power;
    }
    power *= f.fall;
  }
  return value;
}

// channel: 0 is also the factor.
double NoiseAt(const NodeTexture& node, Vec3d p, int channel) {
  NodePlace q =
      PlaceOf(node, p, kNoiseDimensions, kNoiseW, kNoiseWFrom, NumberOf(node, kNoiseScale));
  if (const double distortion = NumberOf(node, kNoiseDistortion); distortion != 0) {
    const auto moved = [&](float seed) { return NoiseOf(q + ShiftOf(seed, q.dimensions)); };
    NodePlace by{{}, 0, q.dimensions};
    if (q.dimensions == 1) {
      by.w = moved(0);
    } else {
      by.p = {moved(0), moved(1), q.dimensions == 2 ? 0 : moved(2)};
      if (q.dimensions == 4) by.w = moved(3);
    }
    q = q + distortion * by;
  }
  if (channel > 0) q = q + ShiftOf(static_cast<float>(q.dimensions - 1 + channel), q.dimensions);
  const double detail = NumberOf(node, kNoiseDetail), roughness = NumberOf(node, kNoiseRoughness),
               lacunarity = NumberOf(node, kNoiseLacunarity);
  if (const int type = ChoiceOf(node, kNoiseType); type != kFbm) {
    return FractalAt({type, detail + 1, roughness, lacunarity, NumberOf(node, kNoiseOffset),
                      NumberOf(node, kNoiseGain), true},
                     q);
  }
  const bool normalized = node.numbers[kNoiseNormalize] != 0;
  const double sum = SumOctaves(q, {detail, roughness, lacunarity}, normalized);
  return normalized ? 0.5 * sum + 0.5 : sum;
}

double MusgraveAt(const NodeTexture& node, Vec3d at) {
  const NodePlace p = PlaceOf(node, at, kMusgraveDimensions, kMusgraveW, kMusgraveWFrom,
                              NumberOf(node, kMusgraveScale));
  const double lacunarity = NumberOf(node, kMusgraveLacunarity);
  return FractalAt({ChoiceOf(node, kMusgraveType), NumberOf(node, kMusgraveDetail),
                    Pow(lacunarity, -NumberOf(node, kMusgraveDimension)), lacunarity,
                    NumberOf(node, kMusgraveOffset), NumberOf(node, kMusgraveGain)},
                   p);
}

// --- Patterns ----------------------------------------------------------------------------------

double WaveAt(const NodeTexture& node, Vec3d p) {
  // Whole numbers lie beside the steps of a saw.
  constexpr double kNudge = 1e-6;
  p = (1 - kNudge) * (NumberOf(node, kWaveScale) * p + Vec3d{kNudge, kNudge, kNudge});
  const int direction = ChoiceOf(node, kWaveDirection);
  double phase = 0;
  if (ChoiceOf(node, kWaveType) == 0) {
    phase = direction == 3 ? 10 * (p.x + p.y + p.z) : 20 * p[direction];
  } else {
    Vec3d across = p;
    if (direction < 3) across[direction] = 0;
    phase = 20 * Length(across);
  }
  phase += NumberOf(node, kWavePhase);
  if (const double distortion = NumberOf(node, kWaveDistortion); distortion != 0) {
    const Octaves octaves{NumberOf(node, kWaveDetail), NumberOf(node, kWaveDetailRoughness), 2};
    phase +=
        distortion * SumOctaves(NumberOf(node, kWaveDetailScale) * NodePlace{p}, octaves, true);
  }
  const int profile = ChoiceOf(node, kWaveProfile);
  if (profile == 0) return 0.5 + 0.5 * Sin(phase - 0.5 * kPi);
  const double turns = phase / (2 * kPi);
  if (profile == 1) return turns - std::floor(turns);
  return 2 * std::fabs(turns - std::floor(turns + 0.5));
}

Vec3d MagicAt(const NodeTexture& node, Vec3d p) {
  const double factor = 5 * NumberOf(node, kMagicScale), amount = NumberOf(node, kMagicDistortion);
  const int depth = ChoiceOf(node, kMagicDepth);
  for (int i = 0; i < 3; ++i) p[i] = std::fmod(p[i], 2 * kPi);
  double x = Sin((p.x + p.y + p.z) * factor), y = Cos((-p.x + p.y - p.z) * factor),
         z = -Cos((-p.x - p.y + p.z) * factor);
  if (depth > 0) {
    x *= amount;
    y *= amount;
    z *= amount;
    y = -Cos(x - y + z) * amount;
  }
  if (depth > 1) x = Cos(x - y - z) * amount;
  if (depth > 2) z = Sin(-x - y - z) * amount;
  if (depth > 3) x = -Cos(-x + y - z) * amount;
  if (depth > 4) y = -Sin(-x + y + z) * amount;
  if (depth > 5) y = -Cos(-x + y + z) * amount;
  if (depth > 6) x = Cos(x + y + z) * amount;
  if (depth > 7) z = Sin(x + y - z) * amount;
  if (depth > 8) x = -Cos(-x - y + z) * amount;
  if (depth > 9) y = -Sin(x - y + z) * amount;
  const double divisor = amount != 0 ? 2 * amount : 1;
  return Vec3d{0.5, 0.5, 0.5} - Vec3d{x, y, z} / divisor;
}

// A number in [0, 1) of a brick.
double RandomOfBrick(uint32_t n) {
  n = (n + 1013) & 0x7fffffff;
  n = (n >> 13) ^ n;
  const uint32_t hash = (n * (n * n * 60493 + 19990303) + 1376312589) & 0x7fffffff;
  return static_cast<double>(hash) / 2147483648.0;
}

double BrickAt(const NodeTexture& node, Vec3d p) {
  constexpr double kBricksMax = 1e9;
  p = NumberOf(node, kBrickScale) * p;
  const double height = NumberOf(node, kBrickRowHeight);
  double width = NumberOf(node, kBrickWidth);
  const double row = std::clamp(std::floor(p.y / height), -kBricksMax, kBricksMax);
  const auto row_number = static_cast<int32_t>(row);
  if (row_number % ChoiceOf(node, kBrickSquashFrequency) == 0) {
    width *= NumberOf(node, kBrickSquash);
  }
  const bool is_moved = row_number % ChoiceOf(node, kBrickOffsetFrequency) == 0;
  const double x_moved = p.x + (is_moved ? width * NumberOf(node, kBrickOffset) : 0);
  const double brick = std::clamp(std::floor(x_moved / width), -kBricksMax, kBricksMax);
  if (ChoiceOf(node, kBrickOutput) == 1) {
    const uint32_t number = (static_cast<uint32_t>(row_number) << 16) +
                            (static_cast<uint32_t>(static_cast<int32_t>(brick)) & 0xffff);
    return std::clamp(RandomOfBrick(number) + NumberOf(node, kBrickBias), 0.0, 1.0);
  }
  const double x = x_moved - width * brick, y = p.y - height * row;
  const double edge = std::fmin(std::fmin(x, y), std::fmin(width - x, height - y));
  const double mortar = NumberOf(node, kBrickMortarSize),
               smooth = NumberOf(node, kBrickMortarSmooth);
  if (edge >= mortar) return 0;
  return smooth == 0 ? 1 : Smooth((1 - edge / mortar) / smooth);
}

double GradientAt(const NodeTexture& node, Vec3d p) {
  const double x = std::clamp(p.x, 0.0, 1.0);
  const double inside = std::fmax(0.999999 - Length(p), 0);
  switch (ChoiceOf(node, kGradientType)) {
    case 0:
      return x;
    case 1:
      return x * x;
    case 2:
      return Smooth(x);
    case 3:
      return std::clamp(0.5 * (p.x + p.y), 0.0, 1.0);
    case 4:
      return Atan2(p.y, p.x) / (2 * kPi) + 0.5;
    case 5:
      return inside * inside;
    default:
      return inside;
  }
}

std::array<float, 3> WhiteNoiseAt(const NodeTexture& node, Vec3d p) {
  const NodePlace q = PlaceOf(node, p, kWhiteDimensions, kWhiteW, kWhiteWFrom, 1);
  const Vec3f at = ToFloat(q.p);
  const auto w = static_cast<float>(q.w);
  switch (q.dimensions) {
    case 1:
      return RandomTripleOf(w);
    case 2:
      return RandomTripleOf(at.x, at.y);
    case 4:
      return RandomTripleOf(at.x, at.y, at.z, w);
    default:
      return RandomTripleOf(at.x, at.y, at.z);
  }
}

}  // namespace

float NodeFactor(const NodeTexture& node, Vec3d place) {
  const Vec3d p = Finite(place);
  switch (node.kind) {
    case NodeTexture::Kind::kNoise:
      return static_cast<float>(NoiseAt(node, p, 0));
    case NodeTexture::Kind::kMusgrave:
      return static_cast<float>(MusgraveAt(node, p));
    case NodeTexture::Kind::kVoronoi:
      return static_cast<float>(VoronoiNodeAt(node, p).distance);
    case NodeTexture::Kind::kWave:
      return static_cast<float>(WaveAt(node, p));
    case NodeTexture::Kind::kMagic: {
      const Vec3d c = MagicAt(node, p);
      return static_cast<float>((c.x + c.y + c.z) / 3);
    }
    case NodeTexture::Kind::kBrick:
      return static_cast<float>(BrickAt(node, p));
    case NodeTexture::Kind::kGradient:
      return static_cast<float>(GradientAt(node, p));
    case NodeTexture::Kind::kWhiteNoise:
      return WhiteNoiseAt(node, p)[0];
    case NodeTexture::Kind::kAttribute:
      break;  // AttributeFactor: it has no place.
  }
  return 0;
}

Rgb NodeColor(const NodeTexture& node, Vec3d place) {
  const Vec3d p = Finite(place);
  const auto rgb = [](Vec3d c) {
    return Rgb{static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z)};
  };
  switch (node.kind) {
    case NodeTexture::Kind::kNoise:
      return rgb({NoiseAt(node, p, 0), NoiseAt(node, p, 1), NoiseAt(node, p, 2)});
    case NodeTexture::Kind::kVoronoi:
      return rgb(VoronoiNodeAt(node, p).color);
    case NodeTexture::Kind::kMagic:
      return rgb(MagicAt(node, p));
    case NodeTexture::Kind::kWhiteNoise: {
      const std::array<float, 3> c = WhiteNoiseAt(node, p);
      return {c[0], c[1], c[2]};
    }
    default:
      return Rgb::Gray(NodeFactor(node, p));
  }
}

float AttributeFactor(const NodeTexture& node, const VertexColor& color) {
  const Rgb rgb{color[0], color[1], color[2]};
  switch (ChoiceOf(node, kAttributeChannel)) {
    case kLuminance:
      return 0.2126f * rgb.r + 0.7152f * rgb.g + 0.0722f * rgb.b;
    case kMeanColor:
      return (rgb.r + rgb.g + rgb.b) / 3;
    case kAlpha:
      return color[3];
    default:
      return rgb[static_cast<size_t>(ChoiceOf(node, kAttributeChannel) - kRed)];
  }
}

double NodeFrequency(const NodeTexture& node) {
  const auto finest = [&](size_t scale, size_t detail, double lacunarity) {
    return std::fabs(NumberOf(node, scale)) *
           std::fmax(Pow(lacunarity, std::ceil(NumberOf(node, detail))), 1);
  };
  switch (node.kind) {
    case NodeTexture::Kind::kNoise:
      return finest(kNoiseScale, kNoiseDetail, NumberOf(node, kNoiseLacunarity));
    case NodeTexture::Kind::kMusgrave:
      return finest(kMusgraveScale, kMusgraveDetail, NumberOf(node, kMusgraveLacunarity));
    case NodeTexture::Kind::kVoronoi:
      return finest(kVoronoiScale, kVoronoiDetail, NumberOf(node, kVoronoiLacunarity));
    case NodeTexture::Kind::kWave:
      return std::fmax(
          4 * std::fabs(NumberOf(node, kWaveScale)),
          node.numbers[kWaveDistortion] == 0
              ? 0
              : finest(kWaveScale, kWaveDetail, 2) * std::fabs(NumberOf(node, kWaveDetailScale)));
    case NodeTexture::Kind::kMagic:
      return 4 * std::fabs(NumberOf(node, kMagicScale));
    case NodeTexture::Kind::kBrick:
      return std::fabs(NumberOf(node, kBrickScale)) /
             std::fmax(NumberOf(node, kBrickMortarSize), 1e-3);
    case NodeTexture::Kind::kGradient:
    case NodeTexture::Kind::kAttribute:
      return 1;
    case NodeTexture::Kind::kWhiteNoise:
      return 1000;
  }
  return 1;
}

int NodeOctaves(const NodeTexture& node) {
  switch (node.kind) {
    case NodeTexture::Kind::kNoise:
      return static_cast<int>(node.numbers[kNoiseDetail]) + 2;
    case NodeTexture::Kind::kMusgrave:
      return static_cast<int>(node.numbers[kMusgraveDetail]) + 2;
    case NodeTexture::Kind::kWave:
      return static_cast<int>(node.numbers[kWaveDetail]) + 2;
    case NodeTexture::Kind::kVoronoi:
      return 4 * static_cast<int>(node.numbers[kVoronoiDetail] + 1);
    case NodeTexture::Kind::kAttribute:
      return 0;
    default:
      return 4;
  }
}

}  // namespace sheaf::render
