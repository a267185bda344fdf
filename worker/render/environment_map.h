// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EnvironmentMap: radiance from infinity as a square equal-area map, filtered bilinearly between
// texel centres with octahedral wrap. Sampling draws from exactly the function that is looked up:
// between centres the luminance is bilinear, its marginal and its conditional are piecewise linear,
// and both are inverted in closed form. So the pdf is the looked-up luminance over its mean,
// wherever it is asked, and is positive wherever radiance is. Space: the light's own.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "worker/render/discrete_distribution.h"

namespace sheaf::render {

class EnvironmentMap {
 public:
  // Shape: texels is row-major [size][size]; row 0 is t = 0.
  // Errors: kInvalidArgument naming the first texel that is negative or not finite.
  static absl::StatusOr<EnvironmentMap> Make(int size, const std::vector<Rgb>& texels);

  // d: unit.
  Rgb Radiance(Vec3f d) const;
  // Mean of the filtered map's luminance over the sphere; 0 for a black map.
  double mean_luminance() const { return mean_luminance_; }
  // A unit direction. Requires: mean_luminance() > 0.
  Vec3d Sample(Vec2f u) const;
  // Sample's pdf of a direction with this radiance. Measure: solid angle.
  double Pdf(Rgb radiance) const;
  // Illuminance of a plane facing +z by the rule of pbrt-v4, which takes the mean over all texels
  // where the hemisphere has half of them: half the photometric value.
  double PbrtIlluminance() const;
  size_t size_bytes() const;

 private:
  // Texel x, y in -1 .. size: the map with a border of one texel of wrap around it.
  const Rgb& Padded(int x, int y) const {
    return padded_[static_cast<size_t>(y + 1) * static_cast<size_t>(size_ + 2) +
                   static_cast<size_t>(x + 1)];
  }
  void BuildDistribution();
  void BuildGuides();
  // A node at or near the one where the share u of the row's integral lies.
  size_t GuessNode(size_t row, double u) const;
  // Radiance at texel coordinates (centres at integers), -0.5 <= x, y <= size - 0.5.
  Rgb Bilinear(double x, double y) const;

  int size_ = 0;
  std::vector<Rgb> padded_;
  double mean_luminance_ = 0;
  // Nodes 0 .. size + 1 an axis: the two borders of the map and the texel centres between them. Row
  // j of row_sums_ holds the running integral of the luminance along node row j; rows_ picks the
  // strip between two node rows.
  std::vector<double> node_position_;  // In texel coordinates.
  std::vector<double> row_sums_;       // [size + 2][size + 2].
  // Small copies that stay in the cache, where row_sums_ does not: the rows' totals, and for each
  // row and k in 0 .. kGuideCount the node before which the share k / kGuideCount of its integral
  // lies. They only say where to look first; what is found does not depend on them.
  static constexpr size_t kGuideCount = 64;
  std::vector<double> row_totals_;    // [size + 2].
  std::vector<uint16_t> row_guides_;  // [size + 2][kGuideCount + 1].
  DiscreteDistribution rows_;
};

}  // namespace sheaf::render
