// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DirectScenes: opens scenes in this process.
//
//     files > SceneDescription > CompiledScene
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "common/base/memory_room.h"
#include "common/base/mutex.h"
#include "common/scene/scene_description.h"
#include "common/volume/volume_pages.h"
#include "worker/render/scene/scene_memory.h"
#include "worker/sandbox/scene_opener.h"

namespace sheaf::worker {

// Pages of page files that the scenes of a process used. Thread safety: members may be called
// concurrently.
class PageTotals {
 public:
  void Add(const RenderedPart& part) {
    const MutexLock lock(&mutex_);
    counts_ += part.pages;
    most_bytes_ = std::max(most_bytes_, part.page_bytes);
  }
  volume::PageCounts counts() const {
    const MutexLock lock(&mutex_);
    return counts_;
  }
  // The most that a scene had in memory after a part.
  uint64_t most_bytes() const {
    const MutexLock lock(&mutex_);
    return most_bytes_;
  }

 private:
  mutable Mutex mutex_;
  volume::PageCounts counts_ ABSL_GUARDED_BY(mutex_);
  uint64_t most_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
};

class DirectScenes : public SceneOpener {
 public:
  // Told what a scene holds before each light pass and after each of its tasks, on the threads that
  // render.
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

  // Thread safety: as Open.
  const PageTotals& page_totals() const { return *totals_; }

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
  const std::shared_ptr<PageTotals> totals_ = std::make_shared<PageTotals>();
  Mutex mutex_;
  std::optional<Expected> expected_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::worker
