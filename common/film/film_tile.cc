// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/film_tile.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>

#include "common/base/check.h"
#include "common/film/denoised_output.h"
#include "common/math/double_float.h"
#include "common/math/lanes.h"
#include "common/math/wide_product.h"

namespace sheaf {
namespace {

// Radiance and weight, the sums that are double-floats.
constexpr size_t kWideCount = 4;
constexpr size_t kNarrowCount = kFilmChannelCount - 2 * kWideCount;
constexpr size_t kWideHi = static_cast<size_t>(FilmChannel::kRedHi);
constexpr size_t kWideLo = static_cast<size_t>(FilmChannel::kRedLo);
constexpr size_t kNarrow = static_cast<size_t>(FilmChannel::kAlpha);
static_assert(kWideLo == kWideHi + kWideCount && kNarrow == kWideLo + kWideCount);

constexpr FilmChannel ChannelAt(size_t index) { return static_cast<FilmChannel>(index); }

// One pixel's node of the canonical tree, without replicates. `wide` holds values of DoubleFloats.
struct PixelNode {
  std::array<double, kWideCount> wide{};
  std::array<float, kNarrowCount> narrow{};
};
// Replicate sums of one pixel: R, G, B, weight of each replicate.
using ReplicateNode = std::array<float, kReplicateCount * kReplicateChannelCount>;

// Also checks the products with the weight.
bool IsUsable(const FilmSample& s) {
  std::array<Floats4, 4> values;
  static_assert(sizeof(s) == 3 * sizeof(Floats4));  // All of its members are numbers.
  std::memcpy(values.data(), &s, sizeof(s));
  values[3] = Floats4{s.radiance.r, s.radiance.g, s.radiance.b, s.depth} * s.filter_weight;
  Ints4 usable = Ints4{} - 1;
  for (const Floats4 v : values) {
    usable &= (v <= kSampleMagnitudeMax) & (v >= -kSampleMagnitudeMax);
  }
  return (usable[0] & usable[1] & usable[2] & usable[3]) != 0;
}

bool IsUsable(const OutputSample& s, float weight) {
  bool usable = true;
  for (const float mean : s.means) {
    usable &= std::fabs(mean) <= kSampleMagnitudeMax;
    usable &= std::fabs(static_cast<double>(mean) * static_cast<double>(weight)) <=
              static_cast<double>(kSampleMagnitudeMax);
  }
  return usable;
}

PixelNode MakeLeaf(const FilmSample& s) {
  PixelNode leaf;
  for (size_t i = 0; i < 3; ++i) leaf.wide[i] = WideProduct(s.radiance[i], s.filter_weight);
  leaf.wide[3] =
      static_cast<double>(s.filter_weight) + 0.0;  // Not -0: an empty sum has the bits of 0.
  const float w = s.filter_weight;
  leaf.narrow = {s.alpha * w,
                 s.albedo.r * w,
                 s.albedo.g * w,
                 s.albedo.b * w,
                 s.normal.x * w,
                 s.normal.y * w,
                 s.normal.z * w,
                 s.depth * w,
                 1,
                 0};
  return leaf;
}

PixelNode MakeNonFiniteLeaf() {
  PixelNode leaf;
  leaf.narrow[kNarrowCount - 1] = 1;
  return leaf;
}

PixelNode Merge(const PixelNode& left, const PixelNode& right) {
  PixelNode sum;
  for (size_t i = 0; i < kWideCount; ++i) {
    sum.wide[i] = DoubleFloat::Round(left.wide[i] + right.wide[i]);
  }
  for (size_t i = 0; i < kNarrowCount; ++i) sum.narrow[i] = left.narrow[i] + right.narrow[i];
  return sum;
}
ReplicateNode Merge(const ReplicateNode& left, const ReplicateNode& right) {
  ReplicateNode sum;
  for (size_t i = 0; i < sum.size(); ++i) sum[i] = left[i] + right[i];
  return sum;
}

// A binary counter of tree nodes: pushing leaf number n merges as many pairs as n has trailing
// ones, which is exactly the canonical tree. It holds at most one node per level.
template <typename Node>
class NodeStack {
 public:
  void Clear() { leaf_count_ = 0, depth_ = 0; }
  void Push(Node node) {
    for (uint64_t n = leaf_count_++; n & 1; n >>= 1) node = Merge(nodes_[--depth_], node);
    nodes_[depth_++] = node;
  }
  uint64_t leaf_count() const { return leaf_count_; }
  // Requires: leaf_count() is a power of two.
  const Node& Root() const {
    SHEAF_CHECK(depth_ == 1);
    return nodes_[0];
  }

 private:
  // A block has at most 2^62 leaves.
  std::array<Node, 63> nodes_;
  uint64_t leaf_count_ = 0;
  size_t depth_ = 0;
};

}  // namespace

FilmTile::FilmTile(PixelRect rect, SampleBlock block, FilmOutputs outputs)
    : rect_(rect), block_(block), outputs_(std::move(outputs)) {
  SHEAF_CHECK(!rect.IsEmpty() && IsAligned(block));
  plane_size_ = static_cast<size_t>(rect.PixelCount());
  main_.resize(kFilmChannelCount * plane_size_);
  replicates_.resize(replicate_count() * kReplicateChannelCount * plane_size_);
  means_.resize(mean_count() * 2 * plane_size_);
  for (size_t i = 0; i < kIdKindCount; ++i) {
    if (outputs_.HasIds(static_cast<IdKind>(i))) ids_[i].pixels.resize(plane_size_);
  }
}

size_t FilmTile::size_bytes() const {
  size_t bytes = (main_.size() + replicates_.size() + means_.size()) * sizeof(float);
  for (const IdSums& ids : ids_) bytes += ids.size_bytes();
  return bytes;
}

uint32_t FilmTile::replicate_first() const { return ReplicateOf(block_.first); }
uint32_t FilmTile::replicate_count() const {
  return static_cast<uint32_t>(std::min<uint64_t>(block_.count, kReplicateCount));
}

FilmTile MergeSiblings(const FilmTile& left, const FilmTile& right) {
  SHEAF_CHECK(right.block() == Sibling(left.block()) && left.block().first < right.block().first);
  return AddTiles(left, right, Parent(left.block()));
}

namespace {

void AddWide(const float* left_hi, const float* left_lo, const float* right_hi,
             const float* right_lo, size_t size, float* hi, float* lo) {
  for (size_t p = 0; p < size; ++p) {
    const DoubleFloat total = Add({left_hi[p], left_lo[p]}, {right_hi[p], right_lo[p]});
    hi[p] = total.hi;
    lo[p] = total.lo;
  }
}

void AddPlanes(const FilmTile& left, const FilmTile& right, FilmTile* sum) {
  const size_t size = sum->plane_size();
  for (size_t i = 0; i < kWideCount; ++i) {
    const FilmChannel hi = ChannelAt(kWideHi + i), lo = ChannelAt(kWideLo + i);
    AddWide(left.channel(hi), left.channel(lo), right.channel(hi), right.channel(lo), size,
            sum->channel(hi), sum->channel(lo));
  }
  for (size_t i = 0; i < sum->mean_count(); ++i) {
    AddWide(left.mean(i, 0), left.mean(i, 1), right.mean(i, 0), right.mean(i, 1), size,
            sum->mean(i, 0), sum->mean(i, 1));
  }
  for (size_t i = kNarrow; i < kFilmChannelCount; ++i) {
    const float* a = left.channel(ChannelAt(i));
    const float* b = right.channel(ChannelAt(i));
    float* out = sum->channel(ChannelAt(i));
    for (size_t p = 0; p < size; ++p) out[p] = a[p] + b[p];
  }
}

void AddIds(const IdSums& left, const IdSums& right, IdSums* sum) {
  *sum = left;
  IdList scratch;
  for (size_t p = 0; p < sum->pixels.size(); ++p) {
    MergeIds(right.pixels[p], &sum->pixels[p], &scratch);
  }
  sum->names.insert(right.names.begin(), right.names.end());
}

// The replicate's plane, or null if the tile's block has no sample of it.
const float* FindReplicate(const FilmTile& tile, uint32_t replicate, size_t component) {
  const uint32_t first = tile.replicate_first();
  if (replicate < first || replicate >= first + tile.replicate_count()) return nullptr;
  return tile.replicate(replicate - first, component);
}

}  // namespace

FilmTile AddTiles(const FilmTile& left, const FilmTile& right, SampleBlock block) {
  SHEAF_CHECK(left.rect() == right.rect() && left.outputs() == right.outputs());
  SHEAF_CHECK(Contains(block, left.block()) && Contains(block, right.block()));
  // A sum with gaps has the block it lies in, which may extend over the next node.
  SHEAF_CHECK(left.block().first < right.block().first);
  FilmTile sum(left.rect(), block, left.outputs());
  AddPlanes(left, right, &sum);
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const auto kind = static_cast<IdKind>(i);
    AddIds(left.ids(kind), right.ids(kind), &sum.ids(kind));
  }
  const size_t size = sum.plane_size();
  for (uint32_t slot = 0; slot < sum.replicate_count(); ++slot) {
    for (size_t component = 0; component < kReplicateChannelCount; ++component) {
      const float* a = FindReplicate(left, sum.replicate_first() + slot, component);
      const float* b = FindReplicate(right, sum.replicate_first() + slot, component);
      float* out = sum.replicate(slot, component);
      if (a != nullptr && b != nullptr) {
        for (size_t p = 0; p < size; ++p) out[p] = a[p] + b[p];
      } else if (a != nullptr || b != nullptr) {
        std::copy_n(a != nullptr ? a : b, size, out);
      }
    }
  }
  return sum;
}

struct PixelAccumulator::Stack {
  NodeStack<PixelNode> main;
  // All replicates have trees of the same shape: one stack whose nodes hold all of them, and one
  // leaf that is refilled for each push as their samples arrive.
  NodeStack<ReplicateNode> replicates;
  ReplicateNode replicate_leaf{};
  int32_t x = 0, y = 0;
};

// Nodes of the canonical tree for the outputs of one pixel. Merges in place, like a NodeStack.
class PixelAccumulator::OutputStack {
 public:
  explicit OutputStack(const FilmOutputs& outputs)
      : mean_count_(MeanChannelCount(outputs)), first_guide_(FirstGuideMean(outputs)) {}

  void Clear() { leaf_count_ = 0, depth_ = 0; }
  // An unusable sample leaves an empty leaf. guides: summed for the denoised output; null for a
  // sample of an odd replicate.
  void Push(const OutputSample& sample, const FilmSample* guides, float weight, bool usable) {
    if (means_.size() < (depth_ + 1) * mean_count_) means_.resize((depth_ + 1) * mean_count_);
    double* leaf = means_.data() + depth_ * mean_count_;
    for (size_t i = 0; i < mean_count_; ++i) {
      leaf[i] = usable ? WideProduct(sample.means[i], weight) : 0.0;
    }
    if (first_guide_ != SIZE_MAX && guides != nullptr && usable) {
      const std::array<float, kGuideCount> values = GuidesOf(*guides);
      for (size_t k = 0; k < kGuideCount; ++k) {
        leaf[first_guide_ + k] = WideProduct(values[k], weight);
      }
    }
    if (ids_.size() <= depth_) ids_.resize(depth_ + 1);
    for (size_t i = 0; i < kIdKindCount; ++i) {
      ids_[depth_][i].clear();
      if (usable && sample.ids[i] != kNoId && weight != 0) {
        ids_[depth_][i].push_back({sample.ids[i], static_cast<double>(weight)});
      }
    }
    ++depth_;
    for (uint64_t n = leaf_count_++; n & 1; n >>= 1) MergeTop();
  }
  void StoreRoot(size_t p, FilmTile* tile) const {
    SHEAF_CHECK(depth_ == 1);
    for (size_t i = 0; i < mean_count_; ++i) {
      const DoubleFloat wide = DoubleFloat::Make(means_[i]);
      tile->mean(i, 0)[p] = wide.hi;
      tile->mean(i, 1)[p] = wide.lo;
    }
    for (size_t i = 0; i < kIdKindCount; ++i) {
      const auto kind = static_cast<IdKind>(i);
      if (tile->outputs().HasIds(kind)) tile->ids(kind).pixels[p] = ids_[0][i];
    }
  }

 private:
  void MergeTop() {
    --depth_;
    double* left = means_.data() + (depth_ - 1) * mean_count_;
    const double* right = means_.data() + depth_ * mean_count_;
    for (size_t i = 0; i < mean_count_; ++i) left[i] = DoubleFloat::Round(left[i] + right[i]);
    for (size_t i = 0; i < kIdKindCount; ++i) {
      MergeIds(ids_[depth_][i], &ids_[depth_ - 1][i], &scratch_);
    }
  }

  const size_t mean_count_, first_guide_;
  std::vector<double> means_;                          // [depth][mean], values of DoubleFloats.
  std::vector<std::array<IdList, kIdKindCount>> ids_;  // [depth]
  IdList scratch_;
  uint64_t leaf_count_ = 0;
  size_t depth_ = 0;
};

PixelAccumulator::PixelAccumulator(FilmTile* tile)
    : tile_(tile), stack_(std::make_unique<Stack>()) {
  if (!tile->outputs().empty()) output_stack_ = std::make_unique<OutputStack>(tile->outputs());
  non_finite_.reserve(kNonFiniteReportsMax);
}
PixelAccumulator::~PixelAccumulator() = default;

void PixelAccumulator::Begin(int32_t x, int32_t y) {
  const PixelRect& rect = tile_->rect();
  SHEAF_CHECK(x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1);
  stack_->main.Clear();
  stack_->replicates.Clear();
  if (output_stack_ != nullptr) output_stack_->Clear();
  stack_->x = x;
  stack_->y = y;
}

void PixelAccumulator::Add(uint64_t sample_index, const FilmSample& sample) {
  SHEAF_CHECK(output_stack_ == nullptr);
  AddLeaf(sample_index, sample, IsUsable(sample));
}

void PixelAccumulator::Add(uint64_t sample_index, const FilmSample& sample,
                           const OutputSample& outputs) {
  SHEAF_CHECK(output_stack_ != nullptr && outputs.means.size() == tile_->mean_count());
  const bool usable = IsUsable(sample) && IsUsable(outputs, sample.filter_weight);
  AddLeaf(sample_index, sample, usable);
  const bool is_even = ReplicateOf(sample_index) % 2 == 0;
  output_stack_->Push(outputs, is_even ? &sample : nullptr, sample.filter_weight, usable);
}

void PixelAccumulator::AddLeaf(uint64_t sample_index, const FilmSample& sample, bool usable) {
  const SampleBlock block = tile_->block();
  const uint64_t ordinal = stack_->main.leaf_count();
  SHEAF_CHECK(sample_index == block.first + ordinal && ordinal < block.count);
  if (!usable && non_finite_.size() < kNonFiniteReportsMax) {
    non_finite_.push_back({stack_->x, stack_->y, sample_index});
  }
  const PixelNode leaf = usable ? MakeLeaf(sample) : MakeNonFiniteLeaf();
  stack_->main.Push(leaf);

  const uint32_t slot = ReplicateOf(sample_index) - tile_->replicate_first();
  for (size_t i = 0; i < kReplicateChannelCount; ++i) {
    stack_->replicate_leaf[slot * kReplicateChannelCount + i] = static_cast<float>(leaf.wide[i]);
  }
  if (slot + 1 == tile_->replicate_count()) stack_->replicates.Push(stack_->replicate_leaf);
}

void PixelAccumulator::End() {
  const uint64_t count = stack_->main.leaf_count();
  const uint64_t replicate_count = tile_->replicate_count();
  SHEAF_CHECK(count == tile_->block().count ||
              (count < replicate_count && std::has_single_bit(count)));
  if (count < replicate_count) {
    // The other replicates have no samples.
    std::fill_n(stack_->replicate_leaf.begin() + count * kReplicateChannelCount,
                (replicate_count - count) * kReplicateChannelCount, 0.0F);
    stack_->replicates.Push(stack_->replicate_leaf);
  }
  const PixelRect& rect = tile_->rect();
  const size_t p = rect.IndexOf(stack_->x, stack_->y);
  const PixelNode& root = stack_->main.Root();
  for (size_t i = 0; i < kWideCount; ++i) {
    const DoubleFloat wide = DoubleFloat::Make(root.wide[i]);
    tile_->channel(ChannelAt(kWideHi + i))[p] = wide.hi;
    tile_->channel(ChannelAt(kWideLo + i))[p] = wide.lo;
  }
  for (size_t i = 0; i < kNarrowCount; ++i) {
    tile_->channel(ChannelAt(kNarrow + i))[p] = root.narrow[i];
  }
  if (output_stack_ != nullptr) output_stack_->StoreRoot(p, tile_);
  const ReplicateNode& replicates = stack_->replicates.Root();
  for (uint32_t slot = 0; slot < tile_->replicate_count(); ++slot) {
    for (size_t i = 0; i < kReplicateChannelCount; ++i) {
      tile_->replicate(slot, i)[p] = replicates[slot * kReplicateChannelCount + i];
    }
  }
}

}  // namespace sheaf
