// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneCache: the scenes that are ready to render, with least-recently-used eviction. A scene is
// loaded once for any number of threads that request it; the others wait. A scene that a thread
// still renders stays in memory after its eviction until the thread is done: the only place where
// ownership is shared.
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

// As LoadResult, but shared.
struct SharedLoadResult {
  SharedScene scene;
  absl::Status status;
  FailureKind failure_kind = FailureKind::kInternal;
};

// Maximum number of scenes in memory, however small: each keeps texture files open, too.
inline constexpr size_t kScenesMax = 64;

// Thread safety: all members may be called concurrently.
class SceneCache {
 public:
  // Keeps scenes of at most memory_bytes_max in total, and at most kScenesMax; always keeps the one
  // that was requested last.
  // Requires: loader outlives this.
  SceneCache(SceneLoader* loader, uint64_t memory_bytes_max)
      : loader_(loader), memory_bytes_max_(memory_bytes_max) {}

  // Returns the lease's scene, and loads it if it is absent. All waiting threads receive the error
  // of a failed load, and the next request retries it; a load that runs out of memory evicts all
  // other scenes, so that the next one has their room. A thread that waits for another's load and
  // whose own stop is requested gets kCancelled.
  SharedLoadResult Get(const Lease& lease, std::stop_token stop);

  // Whether Get would load the lease's scene, or wait for its load.
  bool MustLoad(const Lease& lease) const;

  // Drops a scene whose files changed: the next request loads it again.
  void Drop(const Lease& lease, const SharedScene& scene);

  // Digests of the manifests of the scenes in memory, in ascending order.
  std::vector<std::string> WarmScenes() const;
  // Total over the scenes in memory.
  uint64_t MemoryBytes() const;

 private:
  // Compiled scenes depend on the settings too, which the frame digest covers.
  using Key = std::pair<std::string, bool>;
  struct Entry {
    SharedScene scene;
    std::string manifest;  // Digest.
    uint64_t last_use = 0;
  };
  // A load in progress. Waiting threads share it, so its result outlives its table entry.
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
  // Removes all scenes. Requires: mutex_ is held.
  std::vector<SharedScene> EvictAll();
  // Removes the least recently used scenes, but never the last one. Requires: mutex_ is held.
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
