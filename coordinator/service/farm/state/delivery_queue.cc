// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/state/delivery_queue.h"

#include <utility>

namespace sheaf::coordinator {

void DeliveryQueue::Add(const FrameId& frame) {
  const MutexLock lock(&mutex_);
  frames_.push_back(frame);
}

void DeliveryQueue::Wake() {
  {
    const MutexLock lock(&mutex_);
    wake_ = true;
  }
  changed_.NotifyAll();
}

void DeliveryQueue::Stop() {
  {
    const MutexLock lock(&mutex_);
    stopped_ = true;
  }
  changed_.NotifyAll();
}

std::vector<FrameId> DeliveryQueue::TakeAll() {
  const MutexLock lock(&mutex_);
  return std::exchange(frames_, {});
}

bool DeliveryQueue::Wait(absl::Duration timeout) {
  const MutexLock lock(&mutex_);
  const auto has_reason = [this]()
                              ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return stopped_ || wake_; };
  changed_.WaitFor(&mutex_, timeout, has_reason);
  wake_ = false;
  return !stopped_;
}

}  // namespace sheaf::coordinator
