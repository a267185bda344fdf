// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/pending_frames.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace sheaf::coordinator {

PendingFrames::PendingFrames(uint32_t frame_count, SceneOf scene_of)
    : scene_of_(std::move(scene_of)),
      pending_(frame_count, true),
      count_(frame_count),
      by_scene_(frame_count),
      next_(frame_count + 1) {
  std::iota(by_scene_.begin(), by_scene_.end(), 0);
  std::ranges::stable_sort(by_scene_, {}, scene_of_);
  std::iota(next_.begin(), next_.end(), 0);
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

uint32_t PendingFrames::NextFrom(uint32_t position) {
  while (next_[position] != position) {
    next_[position] = next_[next_[position]];
    position = next_[position];
  }
  return position;
}

std::optional<uint32_t> PendingFrames::FirstOf(const PackedDigest& scene) {
  const auto begin = std::ranges::lower_bound(by_scene_, scene, {}, scene_of_);
  const uint32_t position = NextFrom(static_cast<uint32_t>(begin - by_scene_.begin()));
  if (position == by_scene_.size()) return std::nullopt;
  const uint32_t index = by_scene_[position];
  if (scene_of_(index) != scene) return std::nullopt;
  return index;
}

void PendingFrames::Erase(uint32_t index) {
  if (!pending_[index]) return;
  pending_[index] = false;
  --count_;
  while (first_ < pending_.size() && !pending_[first_]) ++first_;
  const PackedDigest& scene = scene_of_(index);
  const auto of_scene = std::ranges::lower_bound(by_scene_, scene, {}, scene_of_);
  const auto at =
      std::lower_bound(of_scene, by_scene_.end(), index, [&](uint32_t candidate, uint32_t wanted) {
        return scene_of_(candidate) == scene && candidate < wanted;
      });
  const auto position = static_cast<uint32_t>(at - by_scene_.begin());
  next_[position] = position + 1;
}

}  // namespace sheaf::coordinator
