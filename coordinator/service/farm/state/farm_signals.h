// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmSignals: wakes callers that wait until something changes on the farm, or until a job ends.
#pragma once

#include <cstddef>
#include <cstdint>

#include "absl/time/time.h"
#include "common/base/mutex.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently, under any other lock.
class FarmSignals {
 public:
  // Something that a FarmView shows has changed.
  void Changed();
  // Jobs have ended, and their ends are durable.
  void JobsEnded(size_t count);

  // Both counts grow whenever such a thing happens.
  uint64_t ChangeCount() const;
  uint64_t EndCount() const;
  // Return the count as soon as it differs from `seen`, at the latest after `timeout`.
  uint64_t WaitForChange(uint64_t seen, absl::Duration timeout) const;
  uint64_t WaitForEnd(uint64_t seen, absl::Duration timeout) const;

 private:
  mutable Mutex mutex_;
  mutable CondVar change_, end_;
  uint64_t change_count_ ABSL_GUARDED_BY(mutex_) = 1;
  uint64_t end_count_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace sheaf::coordinator
