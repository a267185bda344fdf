// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/state/part_removals.h"

#include <cstddef>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"

namespace sheaf::coordinator {

void PartRemovals::Remove(const std::vector<PartRow>& rows) {
  const MutexLock lock(&mutex_);
  for (size_t i = 0; i < rows.size(); ++i) {
    const absl::Status removed = store_.RemovePart(rows[i]);
    disk_.Note(removed);
    if (removed.ok()) {
      left_.erase(rows[i].key);
      continue;
    }
    const size_t more = rows.size() - i - 1;
    LogWarning(absl::StrCat("job ", rows[i].key.frame.job_id, ": a part of frame ",
                            rows[i].key.frame.frame_number, " that nothing needs",
                            more > 0 ? absl::StrCat(" is, with ", more, " more,") : " is",
                            " removed later: ", removed.message()));
    for (; i < rows.size(); ++i) left_.emplace(rows[i].key, rows[i]);
  }
}

absl::Status PartRemovals::MakeRoom(const PartKey& key) {
  const MutexLock lock(&mutex_);
  const auto left = left_.find(key);
  if (left == left_.end()) return absl::OkStatus();
  absl::Status removed = store_.RemovePart(left->second);
  if (removed.ok()) left_.erase(left);
  return removed;
}

void PartRemovals::Retry() {
  const MutexLock lock(&mutex_);
  while (!left_.empty()) {
    const absl::Status removed = store_.RemovePart(left_.begin()->second);
    disk_.Note(removed);
    if (!removed.ok()) return;
    left_.erase(left_.begin());
  }
}

PartKeys PartRemovals::Left() const {
  const MutexLock lock(&mutex_);
  PartKeys keys;
  for (const auto& [key, row] : left_) keys.insert(keys.end(), key);
  return keys;
}

}  // namespace sheaf::coordinator
