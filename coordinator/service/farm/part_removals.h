// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PartRemovals: parts that nothing needs any more, until the disk has removed them. A part that the
// disk refuses to remove keeps its row and its bytes, but it is no part of its frame any more: who
// reads rows leaves it out. It is removed by a later try, or before its key is written again. A
// start knows none of them: it restores those that fit, which are whole or found damaged.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "common/base/mutex.h"
#include "coordinator/service/farm/disk_state.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// It holds no more rows than the store. Thread safety: all members may be called concurrently,
// under the locks of FarmTables.
class PartRemovals {
 public:
  // All arguments must outlive the object.
  PartRemovals(JobStore* store, DiskState* disk) : store_(*store), disk_(*disk) {}

  // From now on the part is none of its frame. Requires: it is not left.
  void Remove(const PartRow& row);
  // Makes the key free for another part. Errors: those of JobStore::RemovePart.
  absl::Status MakeRoom(const PartKey& key);
  // Tries again what the disk refused.
  void Retry();

  // The parts of a job that are none any more, but have rows still. Ask before reading the rows:
  // one of them may go at any time.
  std::vector<PartKey> LeftOf(uint64_t job_id) const;

 private:
  JobStore& store_;
  DiskState& disk_;
  mutable Mutex mutex_;  // Also held while the disk removes, so that no part written later is hit.
  std::vector<PartRow> left_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::coordinator
