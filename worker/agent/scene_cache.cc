// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/scene_cache.h"

#include <algorithm>
#include <set>

#include "worker/agent/task_border.h"

namespace sheaf::worker {

SceneCache::Key SceneCache::KeyOf(const Lease& lease) {
  return {lease.frame_digest, lease.settings.force_generic_variant};
}

bool SceneCache::MustLoad(const Lease& lease) const {
  const MutexLock lock(&mutex_);
  return !entries_.contains(KeyOf(lease));
}

SharedLoadResult SceneCache::Get(const Lease& lease, std::stop_token stop) {
  const Key key = KeyOf(lease);
  std::vector<SharedScene> evicted;  // Outlives the lock.
  const MutexLock lock(&mutex_);
  while (true) {
    if (const auto it = entries_.find(key); it != entries_.end()) {
      it->second.last_use = ++uses_;
      return {it->second.scene, absl::OkStatus(), FailureKind::kInternal};
    }
    const auto it = pending_loads_.find(key);
    if (it == pending_loads_.end()) return Load(key, lease, stop, &evicted);
    const std::shared_ptr<PendingLoad> pending_load = it->second;
    if (!load_done_.Wait(&mutex_, stop, [&] { return pending_load->done; })) {
      return {nullptr, absl::CancelledError("stopped while its scene was loaded"),
              FailureKind::kReleased};
    }
    // The lease that started the load was cancelled; this one was not, so it loads the scene
    // itself.
    if (!absl::IsCancelled(pending_load->result.status)) return pending_load->result;
  }
}

SharedLoadResult SceneCache::Load(const Key& key, const Lease& lease, std::stop_token stop,
                                  std::vector<SharedScene>* evicted) {
  const auto pending_load = std::make_shared<PendingLoad>();
  pending_loads_[key] = pending_load;
  mutex_.Unlock();
  LoadResult loaded;
  const absl::Status in_memory =
      CatchOutOfMemory("loading the scene", [&] { loaded = loader_->Load(lease, stop); });
  if (!in_memory.ok()) loaded = {nullptr, in_memory, FailureKind::kMemory};
  mutex_.Lock();
  pending_load->result = {SharedScene(std::move(loaded.scene)), loaded.status, loaded.failure_kind};
  pending_load->done = true;
  pending_loads_.erase(key);
  if (pending_load->result.scene != nullptr) {
    entries_[key] = {pending_load->result.scene, lease.scene.sha256_hex, ++uses_};
    *evicted = EvictBeyondLimit();
  } else if (loaded.failure_kind == FailureKind::kMemory) {
    *evicted = EvictAll();
  }
  load_done_.NotifyAll();
  return pending_load->result;
}

void SceneCache::Drop(const Lease& lease, const SharedScene& scene) {
  const MutexLock lock(&mutex_);
  const auto it = entries_.find(KeyOf(lease));
  if (it != entries_.end() && it->second.scene == scene) entries_.erase(it);
}

void SceneCache::Clear() {
  std::vector<SharedScene> evicted;  // Outlives the lock.
  const MutexLock lock(&mutex_);
  evicted = EvictAll();
}

std::vector<std::string> SceneCache::WarmScenes() const {
  const MutexLock lock(&mutex_);
  std::set<std::string> manifests;
  for (const auto& [key, entry] : entries_) manifests.insert(entry.manifest);
  return {manifests.begin(), manifests.end()};
}

uint64_t SceneCache::MemoryBytes() const {
  const MutexLock lock(&mutex_);
  return SumOfMemory();
}

uint64_t SceneCache::SumOfMemory() const {
  uint64_t memory_bytes = 0;
  for (const auto& [key, entry] : entries_) memory_bytes += entry.scene->memory_bytes();
  return memory_bytes;
}

std::vector<SharedScene> SceneCache::EvictAll() {
  std::vector<SharedScene> evicted;
  for (auto& [key, entry] : entries_) evicted.push_back(std::move(entry.scene));
  entries_.clear();
  return evicted;
}

std::vector<SharedScene> SceneCache::EvictBeyondLimit() {
  const auto older = [](const auto& a, const auto& b) {
    return a.second.last_use < b.second.last_use;
  };
  std::vector<SharedScene> evicted;
  uint64_t memory_bytes = SumOfMemory();
  while ((memory_bytes > memory_bytes_max_ && entries_.size() > 1) ||
         entries_.size() > kScenesMax) {
    const auto oldest = std::min_element(entries_.begin(), entries_.end(), older);
    memory_bytes -= oldest->second.scene->memory_bytes();
    evicted.push_back(std::move(oldest->second.scene));
    entries_.erase(oldest);
  }
  return evicted;
}

}  // namespace sheaf::worker
