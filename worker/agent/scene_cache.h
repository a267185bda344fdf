// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneCache: the scenes that are ready to render, with least-recently-used eviction. A scene is
// loaded once for any number of threads that request it; the others wait. A scene that a thread
// still renders stays in memory after its eviction until the thread is done: the only place where
// ownership is shared.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "common/base/mutex.h"
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

  // Drops a scene that failed: the next request loads it again.
  void Drop(const Lease& lease, const SharedScene& scene);

  // Drops all scenes.
  void Clear();

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
  // One load under way. Those who wait share it, so its result outlives its place in the table. The
  // cache's mutex guards it.
  struct PendingLoad {
    bool done = false;
    SharedLoadResult result;
  };
  // Loads on this thread; the mutex is released meanwhile. Gives back the scenes that leave the
  // cache: freeing them takes time, for which no lock may be held.
  SharedLoadResult Load(const Key& key, const Lease& lease, std::stop_token stop,
                        std::vector<SharedScene>* evicted) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  static Key KeyOf(const Lease& lease);
  uint64_t SumOfMemory() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Takes all out.
  std::vector<SharedScene> EvictAll() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Takes the least recently used out, never the last one.
  std::vector<SharedScene> EvictBeyondLimit() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  SceneLoader* const loader_;
  const uint64_t memory_bytes_max_;
  mutable Mutex mutex_;
  CondVar load_done_;
  std::map<Key, Entry> entries_ ABSL_GUARDED_BY(mutex_);
  std::map<Key, std::shared_ptr<PendingLoad>> pending_loads_ ABSL_GUARDED_BY(mutex_);
  uint64_t uses_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace sheaf::worker
