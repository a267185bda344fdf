// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/sharing/held_threads.h"

#include <algorithm>

#include "common/base/check.h"

namespace sheaf::coordinator {

int64_t HeldThreads::ThreadsOf(const OnWorker& leases) {
  return std::min(leases.lease_threads, leases.worker_threads);
}

std::array<ShareSubject, 3> HeldThreads::SubjectsOf(const Lease& lease) {
  return {ShareSubject{ShareKind::kUser, lease.user}, ShareSubject{ShareKind::kShow, lease.show},
          ShareSubject{ShareKind::kPool, lease.pool}};
}

void HeldThreads::Add(uint64_t lease_id, const Lease& lease) {
  SHEAF_CHECK(leases_.emplace(lease_id, lease).second);
  for (const ShareSubject& subject : SubjectsOf(lease)) {
    Held& held = held_[subject];
    OnWorker& on_worker = held.workers[lease.worker_id];
    held.threads -= ThreadsOf(on_worker);
    on_worker.lease_threads += lease.lease_threads;
    on_worker.worker_threads = lease.worker_threads;
    ++on_worker.lease_count;
    held.threads += ThreadsOf(on_worker);
  }
}

void HeldThreads::Remove(uint64_t lease_id) {
  const auto found = leases_.find(lease_id);
  if (found == leases_.end()) return;
  const Lease lease = found->second;
  leases_.erase(found);
  for (const ShareSubject& subject : SubjectsOf(lease)) {
    const auto held = held_.find(subject);
    const auto on_worker = held->second.workers.find(lease.worker_id);
    held->second.threads -= ThreadsOf(on_worker->second);
    on_worker->second.lease_threads -= lease.lease_threads;
    if (--on_worker->second.lease_count > 0) {
      held->second.threads += ThreadsOf(on_worker->second);
      continue;
    }
    held->second.workers.erase(on_worker);
    if (held->second.workers.empty()) held_.erase(held);
  }
}

int64_t HeldThreads::Of(const ShareSubject& subject) const {
  const auto held = held_.find(subject);
  return held == held_.end() ? 0 : held->second.threads;
}

int64_t HeldThreads::OfWith(const ShareSubject& subject, const std::string& worker_id,
                            int lease_threads, int worker_threads) const {
  const auto held = held_.find(subject);
  OnWorker on_worker;
  int64_t others = 0;
  if (held != held_.end()) {
    others = held->second.threads;
    const auto found = held->second.workers.find(worker_id);
    if (found != held->second.workers.end()) {
      on_worker = found->second;
      others -= ThreadsOf(on_worker);
    }
  }
  on_worker.lease_threads += lease_threads;
  on_worker.worker_threads = worker_threads;
  return others + ThreadsOf(on_worker);
}

}  // namespace sheaf::coordinator
