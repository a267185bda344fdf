// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneCache: the scenes that are ready to render, least recently used first to go. A scene is
// loaded once however many threads ask for it; the others wait. What a thread still renders stays
// in memory until it is done, also when it has left the cache: the only place where ownership is
// shared.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "worker/agent/scene_loader.h"

namespace sheaf::worker {

using SharedScene = std::shared_ptr<const LoadedScene>;

// As LoadResult, shared.
struct SharedLoadResult {
  SharedScene scene;
  absl::Status status;
  FailureKind failure_kind = FailureKind::kInternal;
};

// Scenes in memory at once, however small: each keeps files too, those of its textures.
inline constexpr size_t kScenesMax = 64;

// Thread safety: all members may be called concurrently.
class SceneCache {
 public:
  // Keeps scenes of memory_bytes_max together, kScenesMax at most; the one that was asked for last
  // is always kept.
  // Requires: loader outlives this.
  SceneCache(SceneLoader* loader, uint64_t memory_bytes_max)
      : loader_(loader), memory_bytes_max_(memory_bytes_max) {}

  // The lease's scene, loaded where it is not there. A failed load is told to all who waited for it
  // and tried anew by the next one who asks; one that lacks memory ends the stay of all other
  // scenes, so that the next one has their room. One who waits for another's load and whose own
  // stop is requested gets kCancelled.
  SharedLoadResult Get(const Lease& lease, std::stop_token stop);

  // Whether Get would load the lease's scene, or wait for its load.
  bool MustLoad(const Lease& lease) const;

  // Lets go of a scene that is not to be trusted any more: the next one who asks loads it anew.
  void Drop(const Lease& lease, const SharedScene& scene);

  // Digests of the manifests of the scenes in memory, in ascending order.
  std::vector<std::string> WarmScenes() const;
  // Of the scenes in memory together.
  uint64_t MemoryBytes() const;

 private:
  // Compiled scenes depend on the settings too, which the frame digest covers.
  using Key = std::pair<std::string, bool>;
  struct Entry {
    SharedScene scene;
    std::string manifest;  // Digest.
    uint64_t last_use = 0;
  };
  // One load under way. Those who wait share it, so its result outlives its place in the table.
  struct Flight {
    bool done = false;
    SharedLoadResult result;
  };
  // Loads on this thread. Requires: lock holds mutex_; it is released while loading.
  SharedLoadResult Load(const Key& key, const Lease& lease, std::stop_token stop,
                        std::unique_lock<std::mutex>* lock);
  static Key KeyOf(const Lease& lease);
  // Requires: mutex_ is held.
  uint64_t SumOfMemory() const;
  // Takes all out. Requires: mutex_ is held.
  std::vector<SharedScene> EvictAll();
  // Takes the least recently used out, never the last one. Requires: mutex_ is held.
  std::vector<SharedScene> EvictBeyondLimit();

  SceneLoader* const loader_;
  const uint64_t memory_bytes_max_;
  mutable std::mutex mutex_;
  std::condition_variable_any landed_;
  std::map<Key, Entry> entries_;
  std::map<Key, std::shared_ptr<Flight>> flights_;
  uint64_t uses_ = 0;
};

}  // namespace sheaf::worker
