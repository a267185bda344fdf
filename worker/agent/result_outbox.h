// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ResultOutbox: finished parts that the coordinator has not acknowledged, oldest first. Bounded in
// bytes: rendering threads wait for room before they begin a task.
#pragma once

#include <cstdint>
#include <list>
#include <vector>

#include "worker/agent/work.h"

namespace sheaf::worker {

class ResultOutbox {
 public:
  explicit ResultOutbox(uint64_t bytes_max) : bytes_max_(bytes_max) {}

  // Whether a thread may begin a task. Parts of running tasks are always accepted afterwards, so
  // the limit is exceeded by at most one part per thread.
  bool HasRoom() const { return size_bytes_ < bytes_max_; }
  bool empty() const { return parts_.empty(); }
  uint64_t size_bytes() const { return size_bytes_; }

  void Push(FinishedPart part);
  // The oldest parts, at most part_count_max. Pointers stay valid until Pop.
  std::vector<const FinishedPart*> Front(size_t part_count_max) const;
  // Removes the oldest part. Requires: not empty.
  void Pop();

 private:
  const uint64_t bytes_max_;
  uint64_t size_bytes_ = 0;
  std::list<FinishedPart> parts_;
};

}  // namespace sheaf::worker
