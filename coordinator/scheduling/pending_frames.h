// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PendingFrames: the frames of a job that no worker has begun and that wait for nothing. Finds the
// first of them, and the first of a scene. Takes less than ten bytes a frame; a call is O(log
// frames), plus a scan of one bit per 4096 frames.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "coordinator/scheduling/packed_frame.h"

namespace sheaf::coordinator {

// A set of numbers below a size, as bits, with one summary bit for each non-empty word.
class NumberSet {
 public:
  NumberSet() = default;
  // All of them.
  explicit NumberSet(uint32_t size);

  bool Has(uint32_t number) const { return words_[number / 64] >> (number % 64) & 1; }
  void Insert(uint32_t number);
  void Erase(uint32_t number);
  // Returns the first number >= `number`, or the size if there is none.
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
  // The scenes of all frames, including frames already opened.
  uint32_t scene_count() const { return scene_count_; }
  // The lowest frame of each scene, pending or not; empty if there are more than scenes_max scenes.
  std::vector<uint32_t> FirstOfScenes(uint32_t scenes_max) const;
  // Requires: not empty.
  uint32_t First() const { return pending_.NextFrom(0); }
  std::optional<uint32_t> FirstOf(const PackedDigest& scene) const;
  // A no-op if it is present.
  void Insert(uint32_t index);
  // A no-op if it is absent.
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
