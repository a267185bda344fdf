// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PartRemovals: parts that are no longer needed, until the disk has removed them. A part that the
// disk refuses to remove keeps its row and its bytes, but no longer belongs to its frame: readers
// of rows skip it. It is removed by a later try, or before its key is written again. The list is
// not durable: a start restores such parts if they fit, and they are whole or detected as damaged.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <tuple>
#include <vector>

#include "absl/status/status.h"
#include "common/base/mutex.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

struct PartKeyOrder {
  static auto Tie(const PartKey& key) {
    return std::tie(key.frame, key.tile.y0, key.tile.x0, key.tile.y1, key.tile.x1, key.block.first,
                    key.block.count, key.cells, key.kind);
  }
  bool operator()(const PartKey& a, const PartKey& b) const { return Tie(a) < Tie(b); }
};
using PartKeys = std::set<PartKey, PartKeyOrder>;

// It holds at most the rows of the store. Thread safety: all members may be called concurrently,
// under the locks of FarmTables.
class PartRemovals {
 public:
  // All arguments must outlive the object.
  PartRemovals(JobStore* store, DiskState* disk) : store_(*store), disk_(*disk) {}

  // From now on these parts do not belong to their frames. If the disk refuses one of them, it and
  // the rest are left for a later try.
  void Remove(const std::vector<PartRow>& rows);
  // Makes the key free for another part. Errors: those of JobStore::RemovePart.
  absl::Status MakeRoom(const PartKey& key);
  // Retries removals that the disk refused.
  void Retry();

  // The parts still to be removed, which have rows. Call this before reading the rows: any of them
  // may be removed at any time.
  PartKeys Left() const;

 private:
  JobStore& store_;
  DiskState& disk_;
  mutable Mutex mutex_;  // Also held while the disk removes, so that no part written later is hit.
  std::map<PartKey, PartRow, PartKeyOrder> left_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::coordinator
