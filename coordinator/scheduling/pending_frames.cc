// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/pending_frames.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <utility>

namespace sheaf::coordinator {
namespace {

constexpr uint32_t kBits = 64;

uint64_t BitOf(uint32_t number) { return uint64_t{1} << (number % kBits); }

// The first set bit from this one on; the number of bits if there is none.
uint32_t NextBit(const std::vector<uint64_t>& words, uint32_t from) {
  for (uint32_t i = from / kBits; i < words.size(); ++i) {
    const uint64_t mask = i == from / kBits ? ~uint64_t{0} << (from % kBits) : ~uint64_t{0};
    if (const uint64_t left = words[i] & mask; left != 0) {
      return i * kBits + static_cast<uint32_t>(std::countr_zero(left));
    }
  }
  return static_cast<uint32_t>(words.size()) * kBits;
}

}  // namespace

NumberSet::NumberSet(uint32_t size)
    : size_(size), words_((size + kBits - 1) / kBits), used_words_(words_.size() / kBits + 1) {
  for (uint32_t number = 0; number < size; ++number) Insert(number);
}

void NumberSet::Insert(uint32_t number) {
  words_[number / kBits] |= BitOf(number);
  used_words_[number / kBits / kBits] |= BitOf(number / kBits);
}

void NumberSet::Erase(uint32_t number) {
  uint64_t& word = words_[number / kBits];
  word &= ~BitOf(number);
  if (word == 0) used_words_[number / kBits / kBits] &= ~BitOf(number / kBits);
}

uint32_t NumberSet::NextFrom(uint32_t number) const {
  if (number >= size_) return size_;
  const uint64_t here = words_[number / kBits] >> (number % kBits);
  if (here != 0) return number + static_cast<uint32_t>(std::countr_zero(here));
  const uint32_t word = NextBit(used_words_, number / kBits + 1);
  if (word >= words_.size()) return size_;
  return word * kBits + static_cast<uint32_t>(std::countr_zero(words_[word]));
}

PendingFrames::PendingFrames(uint32_t frame_count, SceneOf scene_of)
    : scene_of_(std::move(scene_of)),
      count_(frame_count),
      pending_(frame_count),
      by_scene_(frame_count),
      pending_by_scene_(frame_count) {
  std::iota(by_scene_.begin(), by_scene_.end(), 0);
  std::ranges::stable_sort(by_scene_, {}, scene_of_);
  for (uint32_t i = 0; i < frame_count; ++i) {
    if (BeginsScene(i)) ++scene_count_;
  }
}

bool PendingFrames::BeginsScene(uint32_t position) const {
  return position == 0 || scene_of_(by_scene_[position]) != scene_of_(by_scene_[position - 1]);
}

std::vector<uint32_t> PendingFrames::FirstOfScenes(uint32_t scenes_max) const {
  std::vector<uint32_t> indices;
  if (scene_count_ > scenes_max) return indices;
  for (uint32_t i = 0; i < by_scene_.size(); ++i) {
    if (BeginsScene(i)) indices.push_back(by_scene_[i]);
  }
  return indices;
}

std::optional<uint32_t> PendingFrames::FirstOf(const PackedDigest& scene) const {
  const auto begin = std::ranges::lower_bound(by_scene_, scene, {}, scene_of_);
  const uint32_t position =
      pending_by_scene_.NextFrom(static_cast<uint32_t>(begin - by_scene_.begin()));
  if (position == by_scene_.size()) return std::nullopt;
  const uint32_t index = by_scene_[position];
  if (scene_of_(index) != scene) return std::nullopt;
  return index;
}

uint32_t PendingFrames::PositionOf(uint32_t index) const {
  const PackedDigest& scene = scene_of_(index);
  const auto of_scene = std::ranges::lower_bound(by_scene_, scene, {}, scene_of_);
  const auto at =
      std::lower_bound(of_scene, by_scene_.end(), index, [&](uint32_t candidate, uint32_t wanted) {
        return scene_of_(candidate) == scene && candidate < wanted;
      });
  return static_cast<uint32_t>(at - by_scene_.begin());
}

void PendingFrames::Insert(uint32_t index) {
  if (pending_.Has(index)) return;
  pending_.Insert(index);
  pending_by_scene_.Insert(PositionOf(index));
  ++count_;
}

void PendingFrames::Erase(uint32_t index) {
  if (!pending_.Has(index)) return;
  pending_.Erase(index);
  pending_by_scene_.Erase(PositionOf(index));
  --count_;
}

}  // namespace sheaf::coordinator
