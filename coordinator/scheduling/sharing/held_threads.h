// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HeldThreads: the number of threads held by the leases of each user, show and pool. A worker
// counts with at most the threads that it has, because its queued leases cannot render at once.
//
// Thread safety: none. Cost: O(log n).
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>

#include "coordinator/core/job/share_setting.h"

namespace sheaf::coordinator {

class HeldThreads {
 public:
  // A lease of a worker, and the subjects that it is charged to.
  struct Lease {
    std::string user, show, pool;
    std::string worker_id;
    int lease_threads = 1;   // Threads it renders with.
    int worker_threads = 1;  // Threads of its worker.
  };
  // Requires: the id is new.
  void Add(uint64_t lease_id, const Lease& lease);
  // A no-op if the lease is absent.
  void Remove(uint64_t lease_id);

  int64_t Of(const ShareSubject& subject) const;
  // The same, if a worker held one more lease of the subject.
  int64_t OfWith(const ShareSubject& subject, const std::string& worker_id, int lease_threads,
                 int worker_threads) const;

 private:
  struct OnWorker {
    int64_t lease_threads = 0;  // Sum over its leases.
    int64_t worker_threads = 0;
    int64_t lease_count = 0;
  };
  struct Held {
    int64_t threads = 0;
    std::map<std::string, OnWorker> workers;
  };
  static int64_t ThreadsOf(const OnWorker& leases);
  static std::array<ShareSubject, 3> SubjectsOf(const Lease& lease);

  std::map<ShareSubject, Held> held_;
  std::unordered_map<uint64_t, Lease> leases_;
};

}  // namespace sheaf::coordinator
