// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PendingFrames: those of a job's frames that no worker has begun and that wait for nothing, the
// first of them, and the first of a scene. Less than ten bytes a frame; a call is O(log frames),
// and a scan of a bit for each 4096 frames.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "coordinator/scheduling/packed_frame.h"

namespace sheaf::coordinator {

// A set of numbers below a size, as bits, with a bit for each word of them that has some.
class NumberSet {
 public:
  NumberSet() = default;
  // All of them.
  explicit NumberSet(uint32_t size);

  bool Has(uint32_t number) const { return words_[number / 64] >> (number % 64) & 1; }
  void Insert(uint32_t number);
  void Erase(uint32_t number);
  // The first one that is no less; the size where there is none.
  uint32_t NextFrom(uint32_t number) const;

 private:
  uint32_t size_ = 0;
  std::vector<uint64_t> words_, used_words_;
};

class PendingFrames {
 public:
  using SceneOf = std::function<const PackedDigest&(uint32_t index)>;

  PendingFrames() = default;
  // All of them. scene_of: of a frame; outlives this.
  PendingFrames(uint32_t frame_count, SceneOf scene_of);

  bool empty() const { return count_ == 0; }
  uint32_t count() const { return count_; }
  // Of all frames, those that have left among them.
  uint32_t scene_count() const { return scene_count_; }
  // The lowest frame of each scene, pending or not; none where there are more scenes than this.
  std::vector<uint32_t> FirstOfScenes(uint32_t scenes_max) const;
  // Requires: not empty.
  uint32_t First() const { return pending_.NextFrom(0); }
  std::optional<uint32_t> FirstOf(const PackedDigest& scene) const;
  // Nothing happens to one that is there.
  void Insert(uint32_t index);
  // Nothing happens to one that has left.
  void Erase(uint32_t index);

 private:
  uint32_t PositionOf(uint32_t index) const;  // In by_scene_.
  // Whether the frame at this position of by_scene_ is the first of its scene.
  bool BeginsScene(uint32_t position) const;

  SceneOf scene_of_;
  uint32_t count_ = 0, scene_count_ = 0;
  NumberSet pending_;               // Indices.
  std::vector<uint32_t> by_scene_;  // Indices, by scene and index.
  NumberSet pending_by_scene_;      // Positions in by_scene_.
};

}  // namespace sheaf::coordinator
