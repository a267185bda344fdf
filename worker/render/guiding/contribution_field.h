// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ContributionField: how much paths contribute to the image, by region of a GuidingField and by
// block of pixels. It says how many paths should leave a vertex: more than one where the light
// that the path is going to find is uncertain, large against its pixel, and costs few rays. Source:
// Rath et al. 2022, "EARS: Efficiency-Aware Russian Roulette and Splitting". With V, the variance
// of a sample relative to the square of its pixel, and C, its rays, both means over the image, and
// V_r and C_r, the variance of what a path scatters at a vertex of region r and its further rays,
// the product of error and cost is least where
//
//   number = throughput / pixel * sqrt(V_r / C_r) * sqrt(C / V)
//
// paths continue. The field decides only how noisy an image is, never its mean.
//
// A field is a pure function of integer sums, as GuidingField is: neither order nor threads change
// a bit, nor does a power of two that scales the scene's light or lengths change a decision.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "worker/render/guiding/guiding_field.h"

namespace sheaf::render {

// The blocks of a frame: squares of 2^block_bits pixels.
struct ContributionGrid {
  int32_t width_px = 0, height_px = 0;  // The whole frame.
  uint32_t block_bits = 0;

  size_t columns() const { return Blocks(width_px); }
  size_t rows() const { return Blocks(height_px); }
  size_t size() const { return columns() * rows(); }
  // Pixels outside of the frame count as those at its edge. Requires: size() > 0.
  size_t BlockOf(int32_t x, int32_t y) const {
    return Block(y, height_px) * columns() + Block(x, width_px);
  }

 private:
  size_t Blocks(int32_t size_px) const {
    return (static_cast<size_t>(size_px) + (size_t{1} << block_bits) - 1) >> block_bits;
  }
  size_t Block(int32_t at, int32_t size_px) const {
    return static_cast<size_t>(at < 0 ? 0 : at < size_px ? at : size_px - 1) >> block_bits;
  }
};

inline constexpr uint32_t kContributionBlocksMax = 1u << 16;
// A block is 2^30 pixels wide at most.
inline constexpr uint32_t kContributionBlockBitsMax = 30;

// Frozen. Thread-safe.
class ContributionField {
 public:
  // Knows nothing.
  ContributionField() = default;
  bool empty() const { return regions_.empty(); }

  // The factors of the number of paths, beside the throughput with which a path arrives at the
  // vertex; finite, >= 0. 0: one path continues.
  float PixelFactor(int32_t x, int32_t y) const { return blocks_[grid_.BlockOf(x, y)]; }
  float RegionFactor(uint32_t region) const {
    return region < regions_.size() ? regions_[region] : 0;
  }
  uint32_t region_count() const { return static_cast<uint32_t>(regions_.size()); }
  uint64_t memory_bytes() const;

  // The field as bytes, the same for equal fields on every machine. At most
  // kContributionBytesMax.
  std::string Encode() const;
  // Errors: kDataLoss with the reason, for bytes that Encode did not make; never undefined
  // behavior, whatever the bytes.
  static absl::StatusOr<ContributionField> Decode(std::string_view bytes);

 private:
  friend class ContributionStatistics;

  ContributionGrid grid_;
  std::vector<float> blocks_;   // [block]. Not empty where regions_ is not.
  std::vector<float> regions_;  // [region].
};

inline constexpr size_t kContributionHeaderBytes = 24;
inline constexpr size_t kContributionBytesMax =
    kContributionHeaderBytes +
    sizeof(float) * (size_t{kContributionBlocksMax} + kGuidingRegionsMax);

}  // namespace sheaf::render
