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
  uint32_t count() const { return count_; }
  // Of all frames, those that have left among them.
  uint32_t scene_count() const { return scene_count_; }
  // The lowest frame of each scene, pending or not; none where there are more scenes than this.
  std::vector<uint32_t> FirstOfScenes(uint32_t scenes_max) const;
  // Requires: not empty.
  uint32_t First() const { return first_; }
  std::optional<uint32_t> FirstOf(const PackedDigest& scene);
  // Nothing happens to one that has left.
  void Erase(uint32_t index);

 private:
  // The first position from this one on that is pending; the number of frames where none is.
  uint32_t NextFrom(uint32_t position);
  // Whether the frame at this position of by_scene_ is the first of its scene.
  bool BeginsScene(uint32_t position) const;

  SceneOf scene_of_;
  std::vector<bool> pending_;
  uint32_t count_ = 0, first_ = 0, scene_count_ = 0;
  std::vector<uint32_t> by_scene_;  // Indices, by scene and index.
  // By position in by_scene_: that itself while it is pending, later a position behind it, nearer
  // to the next that is (union by path halving).
  std::vector<uint32_t> next_;
};

}  // namespace sheaf::coordinator
