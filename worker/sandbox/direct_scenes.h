// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DirectScenes: opens scenes in this process.
//
//     files > SceneDescription > CompiledScene
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "common/base/memory_room.h"
#include "common/base/mutex.h"
#include "common/scene/scene_description.h"
#include "worker/render/scene/scene_memory.h"
#include "worker/sandbox/scene_opener.h"

namespace sheaf::worker {

class DirectScenes : public SceneOpener {
 public:
  // Told what a scene holds after each of its tasks, on the threads that render.
  using MemoryWatch = std::function<void(const render::SceneMemory&)>;

  // room_now: the memory that this process may still allocate, by the limits of its environment.
  explicit DirectScenes(
      std::function<MemoryRoom()> room_now = [] { return FindMemoryRoom(); },
      MemoryWatch watch = nullptr)
      : room_now_(std::move(room_now)), watch_(std::move(watch)) {}

  // Gives the description of the scene whose files this manifest lists, as its reader returned it,
  // to the next Open of it, which then reads no scene files. Thread safety: as Open.
  void Expect(std::string manifest_sha256_hex, SceneDescription description);

  OpenResult Open(const SceneInputs& inputs, std::stop_token stop) override;

 private:
  struct Expected {
    std::string manifest_sha256_hex;
    SceneDescription description;
  };
  // The memory that a scene may take now, by its own limit and the environment's.
  MemoryRoom RoomForScene(const SceneLimits& limits) const;
  // Takes the expected description, or reads the scene's files.
  absl::StatusOr<SceneDescription> DescriptionOf(const SceneInputs& inputs, FileSource& source);

  const std::function<MemoryRoom()> room_now_;
  const MemoryWatch watch_;
  Mutex mutex_;
  std::optional<Expected> expected_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::worker
