// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PartRemovals: parts that nothing needs any more, until the disk has removed them. A part that the
// disk refuses to remove keeps its row and its bytes, but it is no part of its frame any more: who
// reads rows leaves it out. It is removed by a later try, or before its key is written again. A
// start knows none of them: it restores those that fit, which are whole or found damaged.
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

// It holds no more rows than the store. Thread safety: all members may be called concurrently,
// under the locks of FarmTables.
class PartRemovals {
 public:
  // All arguments must outlive the object.
  PartRemovals(JobStore* store, DiskState* disk) : store_(*store), disk_(*disk) {}

  // From now on these are no parts of their frames. Where the disk refuses one of them, those that
  // follow are left for a later try, too.
  void Remove(const std::vector<PartRow>& rows);
  // Makes the key free for another part. Errors: those of JobStore::RemovePart.
  absl::Status MakeRoom(const PartKey& key);
  // Tries again what the disk refused.
  void Retry();

  // The parts that are none any more, but have rows still. Ask before reading the rows: one of them
  // may go at any time.
  PartKeys Left() const;

 private:
  JobStore& store_;
  DiskState& disk_;
  mutable Mutex mutex_;  // Also held while the disk removes, so that no part written later is hit.
  std::map<PartKey, PartRow, PartKeyOrder> left_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::coordinator
