// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DirectScenes: opens scenes in this process.
//
//     files > SceneDescription > CompiledScene
#pragma once

#include <functional>
#include <stop_token>
#include <utility>

#include "common/base/memory_room.h"
#include "worker/sandbox/scene_opener.h"

namespace sheaf::worker {

class DirectScenes : public SceneOpener {
 public:
  // room_now: the memory that this process may still allocate, by the limits of its environment.
  explicit DirectScenes(std::function<MemoryRoom()> room_now = [] { return FindMemoryRoom(); })
      : room_now_(std::move(room_now)) {}

  OpenResult Open(const SceneInputs& inputs, std::stop_token stop) override;

 private:
  // The memory that a scene may take now, by its own limit and the environment's.
  MemoryRoom RoomForScene(const SceneLimits& limits) const;

  const std::function<MemoryRoom()> room_now_;
};

}  // namespace sheaf::worker
