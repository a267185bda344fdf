// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/scene_cache.h"

#include <algorithm>
#include <set>

namespace sheaf::worker {

SharedLoadResult SceneCache::Get(const Lease& lease, std::stop_token stop) {
  const Key key{lease.frame_digest, lease.settings.force_generic_variant};
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    if (const auto it = entries_.find(key); it != entries_.end()) {
      it->second.last_use = ++uses_;
      return {it->second.scene, absl::OkStatus(), FailureKind::kInternal};
    }
    const auto it = flights_.find(key);
    if (it == flights_.end()) return Load(key, lease, stop, &lock);
    const std::shared_ptr<Flight> flight = it->second;
    if (!landed_.wait(lock, stop, [&] { return flight->done; })) {
      return {nullptr, absl::CancelledError("stopped while its scene was loaded"),
              FailureKind::kReleased};
    }
    // The lease that loaded was cancelled; this one was not, so it loads the scene itself.
    if (!absl::IsCancelled(flight->result.status)) return flight->result;
  }
}

SharedLoadResult SceneCache::Load(const Key& key, const Lease& lease, std::stop_token stop,
                                  std::unique_lock<std::mutex>* lock) {
  const auto flight = std::make_shared<Flight>();
  flights_[key] = flight;
  lock->unlock();
  LoadResult loaded = loader_->Load(lease, stop);
  lock->lock();
  flight->result = {SharedScene(std::move(loaded.scene)), loaded.status, loaded.failure_kind};
  flight->done = true;
  flights_.erase(key);
  std::vector<SharedScene> evicted;
  if (flight->result.scene != nullptr) {
    entries_[key] = {flight->result.scene, lease.scene.sha256_hex, ++uses_};
    evicted = EvictBeyondLimit();
  }
  landed_.notify_all();
  lock->unlock();  // Freeing a scene takes its time; nobody else waits for it.
  return flight->result;
}

std::vector<std::string> SceneCache::WarmScenes() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::set<std::string> manifests;
  for (const auto& [key, entry] : entries_) manifests.insert(entry.manifest);
  return {manifests.begin(), manifests.end()};
}

uint64_t SceneCache::MemoryBytes() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return SumOfMemory();
}

uint64_t SceneCache::SumOfMemory() const {
  uint64_t memory_bytes = 0;
  for (const auto& [key, entry] : entries_) memory_bytes += entry.scene->memory_bytes();
  return memory_bytes;
}

std::vector<SharedScene> SceneCache::EvictBeyondLimit() {
  const auto older = [](const auto& a, const auto& b) {
    return a.second.last_use < b.second.last_use;
  };
  std::vector<SharedScene> evicted;
  uint64_t memory_bytes = SumOfMemory();
  while (memory_bytes > memory_bytes_max_ && entries_.size() > 1) {
    const auto oldest = std::min_element(entries_.begin(), entries_.end(), older);
    memory_bytes -= oldest->second.scene->memory_bytes();
    evicted.push_back(std::move(oldest->second.scene));
    entries_.erase(oldest);
  }
  return evicted;
}

}  // namespace sheaf::worker
