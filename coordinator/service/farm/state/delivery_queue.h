// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DeliveryQueue: frames whose last result is merged, for the background thread, which waits on it.
#pragma once

#include <vector>

#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently, under any other lock.
class DeliveryQueue {
 public:
  // Adds a frame, which is delivered at the background thread's next wake-up; Wake causes one.
  void Add(const FrameId& frame);
  void Wake();
  // Makes Wait return false from now on.
  void Stop();

  // Takes all frames, in the order in which they were added.
  std::vector<FrameId> TakeAll();
  // Waits for Wake, at most for `timeout`. Returns false after Stop.
  bool Wait(absl::Duration timeout);

 private:
  Mutex mutex_;
  CondVar changed_;
  std::vector<FrameId> frames_ ABSL_GUARDED_BY(mutex_);
  bool wake_ ABSL_GUARDED_BY(mutex_) = false;
  bool stopped_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace sheaf::coordinator
