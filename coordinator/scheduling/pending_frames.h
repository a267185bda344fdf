// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PendingFrames: those of a job's frames that no worker has begun, the first of them, and the first
// of a scene. Frames only leave. Ten bytes a frame; a call is O(log frames), amortized.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "coordinator/scheduling/packed_frame.h"

namespace sheaf::coordinator {

class PendingFrames {
 public:
  using SceneOf = std::function<const PackedDigest&(uint32_t index)>;

  PendingFrames() = default;
  // All of them. scene_of: of a frame; outlives this.
  PendingFrames(uint32_t frame_count, SceneOf scene_of);

  bool empty() const { return count_ == 0; }
  // Requires: not empty.
  uint32_t First() const { return first_; }
  std::optional<uint32_t> FirstOf(const PackedDigest& scene);
  // Nothing happens to one that has left.
  void Erase(uint32_t index);

 private:
  // The first position from this one on that is pending; the number of frames where none is.
  uint32_t NextFrom(uint32_t position);

  SceneOf scene_of_;
  std::vector<bool> pending_;
  uint32_t count_ = 0, first_ = 0;
  std::vector<uint32_t> by_scene_;  // Indices, by scene and index.
  // By position in by_scene_: that itself while it is pending, later a position behind it, nearer
  // to the next that is (union by path halving).
  std::vector<uint32_t> next_;
};

}  // namespace sheaf::coordinator
