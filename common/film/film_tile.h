// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FilmTile: the sums of one tile over one sample block, the unit that is merged.
//
// The canonical tree. A node covers an aligned power-of-two block of sample indices of one tile; a
// leaf is one sample; a parent is its left half plus its right half, with each channel rounded only
// as described below. Worker and coordinator build nodes of the same tree, so the bits of an image
// do not depend on how samples were divided into passes and leases. If the right half is absent (a
// sample count that is not a power of two), a parent equals its left half.
//
// Replicates. Sample n belongs to replicate n % kReplicateCount and is point n / kReplicateCount of
// that replicate's own Owen-scrambled sequence (common/film defines this rule, the sampler follows
// it). Replicate means are independent and identically distributed: error estimates follow from
// their spread.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/film/film_outputs.h"
#include "common/film/id_sums.h"
#include "common/film/tile_geometry.h"
#include "common/math/vec.h"

namespace sheaf {

inline constexpr uint32_t kReplicateCount = 16;
constexpr uint32_t ReplicateOf(uint64_t sample_index) {
  return static_cast<uint32_t>(sample_index % kReplicateCount);
}
constexpr uint64_t IndexInReplicate(uint64_t sample_index) {
  return sample_index / kReplicateCount;
}

// The renderer's result for one sample of one pixel.
struct FilmSample {
  Rgb radiance{};           // Linear sRGB, before the filter weight.
  float alpha = 0;          // 1 if the camera ray hit a surface, else 0.
  float filter_weight = 1;  // Signed; 1 for filters without negative values.
  Rgb albedo{};             // The first surface's, in [0, 1].
  Vec3f normal{};           // Shading normal of the first surface, world space; 0 on a miss.
  float depth = 0;          // Distance along the camera ray in scene units; 0 on a miss.
};

// Sums of one pixel over one block. Radiance and weight, whose quotient is the image, are
// double-floats hi + lo (48 bits, common/math/double_float.h); every other sum is float32. Values
// are multiplied by the filter weight, except the two counts, which are exact up to 2^24.
enum class FilmChannel : uint8_t {
  kRedHi,
  kGreenHi,
  kBlueHi,
  kWeight,
  kRedLo,
  kGreenLo,
  kBlueLo,
  kWeightLo,
  kAlpha,
  kAlbedoR,
  kAlbedoG,
  kAlbedoB,
  kNormalX,
  kNormalY,
  kNormalZ,
  kDepth,
  kSampleCount,     // Finite samples.
  kNonFiniteCount,  // Samples not finite or beyond kSampleMagnitudeMax; in no other sum.
  kCount
};
inline constexpr size_t kFilmChannelCount = static_cast<size_t>(FilmChannel::kCount);
inline constexpr size_t kReplicateChannelCount = 4;  // R, G, B sums and weight, float32.
// A sample with a larger value is treated as not finite: 2^28 samples of this size still have a
// finite sum.
inline constexpr float kSampleMagnitudeMax = 1e30f;

class FilmTile {
 public:
  FilmTile() = default;
  // All sums zero. Requires: IsAligned(block), rect not empty.
  FilmTile(PixelRect rect, SampleBlock block, FilmOutputs outputs = {});

  const PixelRect& rect() const { return rect_; }
  const SampleBlock& block() const { return block_; }
  const FilmOutputs& outputs() const { return outputs_; }
  // Replicates present: those of the block's samples, a contiguous aligned range.
  uint32_t replicate_first() const;
  uint32_t replicate_count() const;

  // Planes are row-major [height][width] over rect().
  float* channel(FilmChannel c) { return main_.data() + static_cast<size_t>(c) * plane_size_; }
  const float* channel(FilmChannel c) const {
    return main_.data() + static_cast<size_t>(c) * plane_size_;
  }
  // slot: 0 .. replicate_count()-1 (replicate replicate_first() + slot); component: 0..3 = R, G, B,
  // weight.
  float* replicate(uint32_t slot, size_t component) {
    return replicates_.data() + (slot * kReplicateChannelCount + component) * plane_size_;
  }
  const float* replicate(uint32_t slot, size_t component) const {
    return replicates_.data() + (slot * kReplicateChannelCount + component) * plane_size_;
  }
  // Sums of the outputs' mean channels (MeanChannelsOf), double-floats; part: 0 = hi, 1 = lo.
  size_t mean_count() const { return MeanChannelCount(outputs_); }
  float* mean(size_t index, size_t part) {
    return means_.data() + (2 * index + part) * plane_size_;
  }
  const float* mean(size_t index, size_t part) const {
    return means_.data() + (2 * index + part) * plane_size_;
  }
  // Has pixels only if outputs().HasIds(kind).
  IdSums& ids(IdKind kind) { return ids_[static_cast<size_t>(kind)]; }
  const IdSums& ids(IdKind kind) const { return ids_[static_cast<size_t>(kind)]; }
  size_t plane_size() const { return plane_size_; }
  size_t size_bytes() const;

  friend bool operator==(const FilmTile&,
                         const FilmTile&) = default;  // Bitwise, except that -0 equals 0.

 private:
  PixelRect rect_;
  SampleBlock block_;
  FilmOutputs outputs_;
  size_t plane_size_ = 0;
  std::vector<float> main_;
  std::vector<float> replicates_;
  std::vector<float> means_;
  std::array<IdSums, kIdKindCount> ids_;
};

// Parent node of two siblings. Requires: same rect and outputs, right.block() ==
// Sibling(left.block()) and left.block().first < right.block().first.
FilmTile MergeSiblings(const FilmTile& left, const FilmTile& right);

// The node over `block` whose right half is incomplete: left plus right as given; a replicate that
// only one of them holds is copied unchanged. MergeSiblings is the complete case.
// Requires: same rect and outputs, both blocks inside `block`, no sample in both, left starts
// before right. (A sum with gaps, as PreviewSum makes, has the block it lies in, which may extend
// over the right one.)
FilmTile AddTiles(const FilmTile& left, const FilmTile& right, SampleBlock block);

// Adds the samples of one pixel of a tile in index order, building the canonical tree with a stack
// of depth log2(block count), without allocation. Use: Begin, Add for every sample of the block in
// ascending index order, End. A pixel may instead have only its first samples: a power of two,
// fewer than the tile has replicates (pixel_lattice.h).
// Thread safety: none; use one per thread. The tile must outlive it.
class PixelAccumulator {
 public:
  explicit PixelAccumulator(FilmTile* tile);
  ~PixelAccumulator();
  PixelAccumulator(const PixelAccumulator&) = delete;
  PixelAccumulator& operator=(const PixelAccumulator&) = delete;
  // x, y: a pixel of the tile, in the frame's raster coordinates.
  void Begin(int32_t x, int32_t y);
  void Add(uint64_t sample_index, const FilmSample& sample);
  // The same for tiles with outputs; `outputs` has their layout.
  void Add(uint64_t sample_index, const FilmSample& sample, const OutputSample& outputs);
  // Requires: every sample of the block has been added, or only the first ones as above.
  void End();
  // The first samples that were not finite, at most kNonFiniteReportsMax, for the report.
  struct NonFinite {
    int32_t x = 0, y = 0;
    uint64_t sample_index = 0;
  };
  static constexpr size_t kNonFiniteReportsMax = 16;
  const std::vector<NonFinite>& non_finite() const { return non_finite_; }

 private:
  struct Stack;
  class OutputStack;
  void AddLeaf(uint64_t sample_index, const FilmSample& sample, bool usable);
  FilmTile* tile_;
  std::unique_ptr<Stack> stack_;
  std::unique_ptr<OutputStack> output_stack_;  // Null without outputs.
  std::vector<NonFinite> non_finite_;
};

}  // namespace sheaf
