// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads the tree of a .vdb grid into a NanoVDB image, in two passes: one counts its nodes, the
// other fills them in. Both trees have the same shape (32^3, 16^3, 8^3) and the same order within a
// node.
#pragma once

#include <array>
#include <bit>
#include <cstring>
#include <string>
#include <vector>

#include "common/volume/image_builder.h"
#include "common/volume/vdb_stream.h"

namespace sheaf::volume {

struct VdbTreeSource {
  VdbStream in;  // At the start of the tree.
  uint32_t compression;
  bool is_half;
};

// Exact conversion from IEEE 754 binary16.
inline float FloatOfHalf(uint16_t half) {
  const uint32_t sign = uint32_t{half & 0x8000u} << 16;
  const uint32_t exponent = (half >> 10) & 31u, fraction = half & 1023u;
  if (exponent == 31) return std::bit_cast<float>(sign | 0x7f800000u | (fraction << 13));
  const float magnitude = exponent == 0
                              ? static_cast<float>(fraction) * 0x1p-24f
                              : std::bit_cast<float>(((exponent + 112) << 23) | (fraction << 13));
  return std::bit_cast<float>(std::bit_cast<uint32_t>(magnitude) | sign);
}

template <typename BuildT>
class VdbTreeReader {
  using Builder = ImageBuilder<BuildT>;
  using Value = typename Builder::Value;
  static_assert(sizeof(Value) % sizeof(float) == 0);
  static constexpr size_t kFloats = sizeof(Value) / sizeof(float);
  template <uint32_t kLog2>
  using Mask = std::array<uint64_t, (size_t{1} << (3 * kLog2)) / 64>;

 public:
  VdbTreeReader(const VdbTreeSource& source, Builder* builder)
      : in_(source.in), source_(source), builder_(builder) {}

  // If builder is null, only counts nodes. False if the file is damaged.
  bool ReadTopology() {
    in_.Get<int32_t>();  // Number of buffers: one.
    background_ = in_.Get<Value>();
    const auto tiles = in_.Get<uint32_t>(), children = in_.Get<uint32_t>();
    for (uint32_t i = 0; i < tiles && in_.ok(); ++i) {
      const auto origin = in_.Get<Index3>();
      const auto value = in_.Get<Value>();
      const bool active = in_.Get<uint8_t>() != 0;
      if (!IsAligned(origin)) in_.Fail();
      ++counts_.root_tiles;
      if (in_.ok() && builder_ != nullptr) builder_->AddRootTile(origin, value, active);
    }
    for (uint32_t i = 0; i < children && in_.ok(); ++i) {
      const auto origin = in_.Get<Index3>();
      if (!IsAligned(origin)) in_.Fail();
      ++counts_.root_tiles;
      ++counts_.upper;
      if (in_.ok()) {
        ReadInternal<5>(builder_ != nullptr ? builder_->AddUpper(origin) : nullptr);
      }
    }
    return in_.ok();
  }
  // Call after ReadTopology: reads the values of the leaves, in file order.
  bool ReadLeaves() {
    for (size_t i = 0; i < leaves_.size() && in_.ok(); ++i) {
      Mask<3> mask;
      in_.Read(mask.data(), sizeof(mask));
      ReadValues<3>(mask, leaves_[i]->data()->mValues);
      std::memcpy(Builder::Words(&leaves_[i]->data()->mValueMask), mask.data(), sizeof(mask));
    }
    return in_.ok();
  }
  const NodeCounts& counts() const { return counts_; }
  Value background() const { return background_; }

 private:
  static bool IsAligned(Index3 origin) { return ((origin[0] | origin[1] | origin[2]) & 4095) == 0; }
  template <uint32_t kLog2, typename Node>
  void ReadInternal(Node* node) {
    Mask<kLog2> children, active;
    in_.Read(children.data(), sizeof(children));
    in_.Read(active.data(), sizeof(active));
    std::vector<Value> values(node != nullptr ? size_t{1} << (3 * kLog2) : 0);
    ReadValues<kLog2>(active, node != nullptr ? values.data() : nullptr);
    if (!in_.ok()) return;
    if (node != nullptr) {
      for (size_t n = 0; n < values.size(); ++n) node->data()->mTable[n].value = values[n];
      std::memcpy(Builder::Words(&node->data()->mValueMask), active.data(), sizeof(active));
    }
    for (uint32_t word = 0; word < children.size(); ++word) {
      for (uint64_t bits = children[word]; bits != 0 && in_.ok(); bits &= bits - 1) {
        ReadChild<kLog2>(node, word * 64 + static_cast<uint32_t>(std::countr_zero(bits)));
      }
    }
  }
  template <uint32_t kLog2, typename Node>
  void ReadChild(Node* node, uint32_t n) {
    if constexpr (kLog2 == 5) {
      ++counts_.lower;
      ReadInternal<4>(node != nullptr ? builder_->AddLower(node, n) : nullptr);
    } else {
      ++counts_.leaf;
      in_.Skip(sizeof(Mask<3>));  // It is repeated with the values.
      if (node != nullptr && in_.ok()) leaves_.push_back(builder_->AddLeaf(node, n));
    }
  }

  // The byte before a node's values: the encoding of the values that are not stored.
  enum Inactive : int8_t {
    kBackground = 0,
    kMinusBackground = 1,
    kOneValue = 2,
    kMaskMinusBackground = 3,
    kMaskOneValue = 4,
    kMaskTwoValues = 5,
    kAllStored = 6
  };

  // out == nullptr: skips the values.
  template <uint32_t kLog2>
  void ReadValues(const Mask<kLog2>& active, Value* out) {
    constexpr size_t kCount = size_t{1} << (3 * kLog2);
    const auto kind = in_.Get<int8_t>();
    if (kind < kBackground || kind > kAllStored) in_.Fail();
    Value second = background_;
    Value first = kind == kBackground ? background_ : background_ * -1.0f;
    if (kind == kOneValue || kind == kMaskOneValue || kind == kMaskTwoValues) {
      first = in_.Get<Value>();
    }
    if (kind == kMaskTwoValues) second = in_.Get<Value>();
    Mask<kLog2> selection{};
    if (kind >= kMaskMinusBackground && kind <= kMaskTwoValues) {
      in_.Read(selection.data(), sizeof(selection));
    }
    size_t stored = kCount;
    const bool packs_active = (source_.compression & VdbStream::kActiveMask) != 0;
    if (packs_active && kind != kAllStored) {
      stored = 0;
      for (const uint64_t word : active) stored += static_cast<size_t>(std::popcount(word));
    }
    ReadNumbers(stored, out != nullptr);
    if (out == nullptr || !in_.ok()) return;
    if (stored == kCount) {
      std::memcpy(static_cast<void*>(out), numbers_.data(), kCount * sizeof(Value));
      return;
    }
    size_t next = 0;
    for (size_t n = 0; n < kCount; ++n) {
      const uint64_t bit = uint64_t{1} << (n & 63);
      if ((active[n >> 6] & bit) != 0) {
        std::memcpy(static_cast<void*>(&out[n]), &numbers_[kFloats * next++], sizeof(Value));
      } else {
        out[n] = (selection[n >> 6] & bit) != 0 ? second : first;
      }
    }
  }
  // Reads into numbers_, as floats.
  void ReadNumbers(size_t value_count, bool wanted) {
    const size_t count = value_count * kFloats;
    if (source_.is_half && count == 0) return;  // Without halves even the length is absent.
    numbers_.resize(std::max(numbers_.size(), count));
    if (!source_.is_half) {
      in_.ReadBlock(source_.compression,
                    {wanted ? reinterpret_cast<std::byte*>(numbers_.data()) : nullptr,
                     count * sizeof(float)});
      return;
    }
    halves_.resize(std::max(halves_.size(), count));
    in_.ReadBlock(source_.compression,
                  {wanted ? reinterpret_cast<std::byte*>(halves_.data()) : nullptr,
                   count * sizeof(uint16_t)});
    if (!wanted || !in_.ok()) return;
    for (size_t i = 0; i < count; ++i) numbers_[i] = FloatOfHalf(halves_[i]);
  }

  VdbStream in_;
  const VdbTreeSource& source_;
  Builder* builder_;
  NodeCounts counts_;
  Value background_{};
  std::vector<float> numbers_ = std::vector<float>(1);
  std::vector<uint16_t> halves_ = std::vector<uint16_t>(1);
  std::vector<typename Builder::Leaf*> leaves_;
};

// Errors: kDataLoss if the file is damaged; kResourceExhausted beyond the limits.
template <typename BuildT>
absl::StatusOr<VolumeBytes> ReadVdbTree(const std::string& where, const std::string& name,
                                        const Matrix4& medium_from_index,
                                        const VdbTreeSource& source, const VolumeLimits& limits) {
  const absl::Status damaged = absl::DataLossError(
      absl::StrCat(where, ": grid \"", name, "\" is cut short or damaged; write the file again"));
  VdbTreeReader<BuildT> counter(source, nullptr);
  if (!counter.ReadTopology()) return damaged;
  auto builder = ImageBuilder<BuildT>::Make(where, name, medium_from_index, counter.counts(),
                                            counter.background(), limits);
  if (!builder.ok()) return builder.status();
  VdbTreeReader<BuildT> filler(source, &*builder);
  if (!filler.ReadTopology() || !filler.ReadLeaves()) return damaged;
  return (*std::move(builder)).TakeImage();
}

}  // namespace sheaf::volume
