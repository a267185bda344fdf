// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/cloud_density.h"

#include <algorithm>
#include <cmath>

namespace sheaf::render {
namespace {

constexpr double kVoxelsPerSide = 64;
constexpr int kOctaves = 5, kDisplacements = 2;
// Each octave has half the amplitude and about half the wavelength of the previous one.
constexpr double kGain = 0.5, kLacunarity = 1.99;
constexpr double kDisplacementFrequency = 10, kDisplacementScale = 0.05;
constexpr double kContrast = 4.5, kFloorHeight = 0.5, kFloorDensity = 2;
constexpr double kDifference = 0.01;         // Step for differentiating the noise.
constexpr double kNoiseSumMax = 1 - 0x1p-5;  // For octaves of amplitude 1/2, 1/4, ... 1/32.

// Source: Perlin 2002: second derivatives vanish at lattice points.
double Fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }

// Dot product of the offset with one of twelve gradients, which point to the edge centers of a
// cube.
double GradientProduct(int64_t x, int64_t y, int64_t z, Vec3d offset) {
  uint64_t h = static_cast<uint64_t>(x) * 0x9e3779b97f4a7c15u;
  h = (h ^ (h >> 32) ^ static_cast<uint64_t>(y)) * 0xbf58476d1ce4e5b9u;
  h = (h ^ (h >> 29) ^ static_cast<uint64_t>(z)) * 0x94d049bb133111ebu;
  h ^= h >> 32;
  const uint64_t edge = (h >> 8) % 12;
  const double a = edge < 8 ? offset.x : offset.y;
  const double b = edge < 4 ? offset.y : offset.z;
  return ((h & 1) != 0 ? a : -a) + ((h & 2) != 0 ? b : -b);
}

double Mix(double t, double a, double b) { return a + t * (b - a); }

Vec3d NoiseGradient(Vec3d p) {
  const double here = GradientNoise(p);
  return {(GradientNoise(p + Vec3d{kDifference, 0, 0}) - here) / kDifference,
          (GradientNoise(p + Vec3d{0, kDifference, 0}) - here) / kDifference,
          (GradientNoise(p + Vec3d{0, 0, kDifference}) - here) / kDifference};
}

}  // namespace

double GradientNoise(Vec3d p) {
  const Vec3d whole{std::floor(p.x), std::floor(p.y), std::floor(p.z)};
  const Vec3d f = p - whole;
  const auto x = static_cast<int64_t>(whole.x), y = static_cast<int64_t>(whole.y),
             z = static_cast<int64_t>(whole.z);
  const auto corner = [&](int i, int j, int k) {
    return GradientProduct(x + i, y + j, z + k, f - Vec3d{double(i), double(j), double(k)});
  };
  const double u = Fade(f.x), v = Fade(f.y), w = Fade(f.z);
  const auto column = [&](int i, int j) { return Mix(w, corner(i, j, 0), corner(i, j, 1)); };
  const double value =
      Mix(u, Mix(v, column(0, 0), column(0, 1)), Mix(v, column(1, 0), column(1, 1)));
  return std::clamp(value, -1.0, 1.0);  // Only rounding can leave the range.
}

CloudDensity::CloudDensity(const Parameters& parameters) : parameters_(parameters) {
  const Vec3d size = parameters.hi - parameters.lo;
  voxel_size_ = std::max({size.x, size.y, size.z}) / kVoxelsPerSide;
}

double CloudDensity::At(Vec3d p) const {
  Vec3d q = parameters_.frequency * p;
  if (parameters_.wispiness > 0) {
    double amplitude = kDisplacementScale * parameters_.wispiness;
    double frequency = kDisplacementFrequency;
    for (int i = 0; i < kDisplacements; ++i) {
      q += amplitude * NoiseGradient(frequency * q);
      amplitude *= kGain;
      frequency *= kLacunarity;
    }
  }
  double sum = 0, amplitude = kGain, frequency = 1;
  for (int i = 0; i < kOctaves; ++i) {
    sum += amplitude * GradientNoise(frequency * q);
    amplitude *= kGain;
    frequency *= kLacunarity;
  }
  const double puffs = std::clamp((1 - p.y) * kContrast * parameters_.density * sum, 0.0, 1.0);
  return std::clamp(puffs + kFloorDensity * std::max(0.0, kFloorHeight - p.y), 0.0, 1.0);
}

IndexBox CloudDensity::Box() const {
  const Vec3d size = parameters_.hi - parameters_.lo;
  return {{0, 0, 0}, size / voxel_size_};
}

DensityBounds CloudDensity::BoundsOver(double y0, double y1) const {
  const double below = parameters_.lo.y + y0 * voxel_size_;
  const double above = parameters_.lo.y + y1 * voxel_size_;
  const double height = std::max(std::fabs(1 - below), std::fabs(1 - above));
  const double puffs = std::min(height * kContrast * parameters_.density * kNoiseSumMax, 1.0);
  const auto floor_at = [](double y) { return kFloorDensity * std::max(0.0, kFloorHeight - y); };
  // Rounded outwards: lookups compute the same in double.
  const auto lower = static_cast<float>(std::min(floor_at(above), 1.0) * (1 - 0x1p-20));
  const auto upper = static_cast<float>(std::min(puffs + floor_at(below), 1.0) * (1 + 0x1p-20));
  return {lower, upper};
}

DensityBounds CloudDensity::Bounds() const {
  const IndexBox box = Box();
  return BoundsOver(box.lo.y - 1, box.hi.y + 1);
}

std::optional<float> CloudDensity::UniformValue(Index3, Index3) const { return std::nullopt; }

void CloudDensity::BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const {
  for (size_t n = 0; n < 64; ++n) {
    const double y = origin[1] + 2.0 * static_cast<double>((n >> 2) & 3);
    cells[n] = BoundsOver(y - 1, y + 3);
  }
}

}  // namespace sheaf::render
