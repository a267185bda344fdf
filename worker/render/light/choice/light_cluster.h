// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightCluster: bounds and sums of a set of lights while a LightTree is built, and the cost of
// keeping the set in one node. Internal to light_tree_build.cc.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "common/math/elementary.h"
#include "common/math/vec.h"

namespace sheaf::render {

// A light, in the form that the builder sorts.
struct LightEntry {
  Vec3f center, half;      // Center and half size of the bounding box.
  Vec3f normal;            // Zero where it emits in all directions.
  float intensity = 0;     // Along the normal.
  float cos_emission = 0;  // Emits where the cosine with the normal is at least this.
  uint32_t light = 0;
  bool two_sided = false;
  bool by_cosine = false;  // Emission falls off with the cosine to the normal.
};

inline Vec3f Minimum(Vec3f a, Vec3f b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}
inline Vec3f Maximum(Vec3f a, Vec3f b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}

// Measure of all directions within pi / 2 of a normal in a cone of half-angle theta, weighted by
// cosine outside the cone. Source: Conty Estevez and Kulla 2018, eq. 1, for theta_e = pi / 2.
inline double OrientationMeasure(double theta) {
  const double reach = std::min(theta + 0.5 * kPi, kPi);
  const SinCosPair<double> t = SinCos(theta);
  return 2 * kPi * (1 - t.cos) +
         0.5 * kPi * (2 * reach * t.sin - Cos(theta - 2 * reach) - 2 * theta * t.sin + t.cos);
}

// OrientationMeasure as a function of the length of the mean normal: normals that are uniform in a
// cap of half-angle theta have a mean of length (1 + cos theta) / 2. This is cheaper than bounding
// cones, and takes the distribution of the normals into account.
class OrientationTable {
 public:
  OrientationTable() {
    for (size_t i = 0; i < table_.size(); ++i) {
      const double length = static_cast<double>(i) / static_cast<double>(table_.size() - 1);
      table_[i] = static_cast<float>(OrientationMeasure(Acos(2 * length - 1)));
    }
  }
  float At(float mean_length) const {
    const float x = std::clamp(mean_length, 0.0f, 1.0f) * static_cast<float>(table_.size() - 1);
    const size_t i = std::min(static_cast<size_t>(x), table_.size() - 2);
    const float t = x - static_cast<float>(i);
    return table_[i] + t * (table_[i + 1] - table_[i]);
  }

 private:
  std::array<float, 65> table_{};
};

// Bounds and sums of a set of lights.
struct LightCluster {
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Vec3f lower{kInfinity, kInfinity, kInfinity}, upper = -lower;  // Bounds of the boxes.
  Vec3f center_lower{kInfinity, kInfinity, kInfinity}, center_upper = -center_lower;
  Vec3f normal_sum{};  // Weighted by intensity.
  float intensity = 0;
  uint32_t count = 0;

  void Add(const LightEntry& entry) {
    lower = Minimum(lower, entry.center - entry.half);
    upper = Maximum(upper, entry.center + entry.half);
    center_lower = Minimum(center_lower, entry.center);
    center_upper = Maximum(center_upper, entry.center);
    normal_sum += entry.normal * entry.intensity;
    intensity += entry.intensity;
    ++count;
  }
  void Add(const LightCluster& other) {
    lower = Minimum(lower, other.lower);
    upper = Maximum(upper, other.upper);
    center_lower = Minimum(center_lower, other.center_lower);
    center_upper = Maximum(center_upper, other.center_upper);
    normal_sum += other.normal_sum;
    intensity += other.intensity;
    count += other.count;
  }
  float Cost(const OrientationTable& orientation) const {
    return intensity * LengthSquared(upper - lower) *
           orientation.At(Length(normal_sum) / intensity);
  }
};

}  // namespace sheaf::render
