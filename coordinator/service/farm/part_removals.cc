// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/part_removals.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"

namespace sheaf::coordinator {

void PartRemovals::Remove(const PartRow& row) {
  const MutexLock lock(&mutex_);
  const absl::Status removed = store_.RemovePart(row);
  disk_.Note(removed);
  if (removed.ok()) return;
  LogWarning(absl::StrCat("job ", row.key.frame.job_id, ": a part of frame ",
                          row.key.frame.frame_number,
                          " that nothing needs is removed later: ", removed.message()));
  left_.push_back(row);
}

absl::Status PartRemovals::MakeRoom(const PartKey& key) {
  const MutexLock lock(&mutex_);
  const auto left = std::find_if(left_.begin(), left_.end(),
                                 [&key](const PartRow& row) { return row.key == key; });
  if (left == left_.end()) return absl::OkStatus();
  absl::Status removed = store_.RemovePart(*left);
  if (removed.ok()) left_.erase(left);
  return removed;
}

void PartRemovals::Retry() {
  const MutexLock lock(&mutex_);
  while (!left_.empty()) {
    const absl::Status removed = store_.RemovePart(left_.back());
    disk_.Note(removed);
    if (!removed.ok()) return;
    left_.pop_back();
  }
}

std::vector<PartKey> PartRemovals::LeftOf(uint64_t job_id) const {
  const MutexLock lock(&mutex_);
  std::vector<PartKey> keys;
  for (const PartRow& row : left_) {
    if (row.key.frame.job_id == job_id) keys.push_back(row.key);
  }
  return keys;
}

}  // namespace sheaf::coordinator
