// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ContributionStatistics: what paths contributed and cost, by region of a GuidingField and by block
// of pixels, as integer sums; Freeze: the ContributionField that follows from them.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "worker/render/guiding/contribution_field.h"

namespace sheaf::render {

// A block is as small as it can be with about this many paths, and at least 4 x 4 pixels.
inline constexpr uint64_t kContributionBlockPaths = 64;
inline constexpr uint32_t kContributionBlockBitsMin = 2;
// Pixels darker than this fraction of the mean image count as that bright: as in relMSE.
inline constexpr double kContributionDark = 0.1;
// The number of paths is this fraction of the one that the sums give. The sums, of few paths, count
// variance twice that could be lessened at one of several vertices; measured: docs/adr/0091.
inline constexpr double kContributionEagerness = 0.3;
// A region's second moment over its squared mean is estimated as if it had this many values more,
// with the ratio of all regions: few values seldom contain the large ones.
inline constexpr double kContributionPriorValues = 64;
// In units: single values, and their squares, in units of 2^12 units. 2^24 of them fit in a sum.
inline constexpr double kContributionValueMax = 0x1p36;
inline constexpr double kContributionSquareUnit = 0x1p12;
inline constexpr double kContributionSquareMax = 0x1p40;
// Rays of one path.
inline constexpr uint64_t kContributionRaysMax = uint64_t{1} << 20;

// For `paths` paths over the whole frame. Requires: a frame with pixels.
ContributionGrid ContributionGridFor(int32_t width_px, int32_t height_px, uint64_t paths);

// The Add functions may be called from many threads; Freeze, after all their calls. Values that are
// too large count as the largest, those that are not finite or negative as 0.
class ContributionStatistics {
 public:
  // unit_exponent: values are counted in units of 2^unit_exponent. Requires: regions and blocks
  // within their limits, |unit_exponent| <= kGuidingUnitExponentMax.
  ContributionStatistics(uint32_t region_count, const ContributionGrid& grid, int unit_exponent);
  // A path left a vertex in the region, scattered that much light there as a multiple of
  // the light that it would carry, and took `rays` rays.
  void AddVertex(uint32_t region, double scattered, uint64_t rays);
  // A path from the pixel brought that radiance, with `rays` rays in all.
  void AddPath(int32_t x, int32_t y, double radiance, uint64_t rays);

  // Empty where no path brought light.
  ContributionField Freeze() const;
  uint64_t memory_bytes() const;

 private:
  struct Sums {
    std::atomic<uint64_t> number{0}, values{0}, squares{0}, rays{0};
  };
  // Means over the values of one region or block.
  struct Means {
    double number = 0, value = 0, square = 0, rays = 0;
  };
  void Add(double value, uint64_t rays, Sums* sums) const;
  Means MeansOf(const Sums& sums) const;
  // The blocks' values, blurred by 3 x 3 blocks.
  std::vector<double> BlurredImage(const std::vector<Means>& blocks) const;
  void SetBlocks(ContributionField* field) const;
  void SetRegions(ContributionField* field) const;

  double units_per_value_, value_of_unit_;
  ContributionGrid grid_;
  std::vector<Sums> regions_, blocks_;
};

}  // namespace sheaf::render
