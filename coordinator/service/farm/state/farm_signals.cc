// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/state/farm_signals.h"

namespace sheaf::coordinator {

void FarmSignals::Changed() {
  {
    const MutexLock lock(&mutex_);
    ++change_count_;
  }
  change_.NotifyAll();
}

void FarmSignals::JobsEnded(size_t count) {
  {
    const MutexLock lock(&mutex_);
    end_count_ += count;
  }
  end_.NotifyAll();
}

uint64_t FarmSignals::ChangeCount() const {
  const MutexLock lock(&mutex_);
  return change_count_;
}

uint64_t FarmSignals::EndCount() const {
  const MutexLock lock(&mutex_);
  return end_count_;
}

uint64_t FarmSignals::WaitForChange(uint64_t seen, absl::Duration timeout) const {
  const MutexLock lock(&mutex_);
  const auto changed = [&]()
                           ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return change_count_ != seen; };
  change_.WaitFor(&mutex_, timeout, changed);
  return change_count_;
}

uint64_t FarmSignals::WaitForEnd(uint64_t seen, absl::Duration timeout) const {
  const MutexLock lock(&mutex_);
  const auto ended = [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return end_count_ != seen; };
  end_.WaitFor(&mutex_, timeout, ended);
  return end_count_;
}

}  // namespace sheaf::coordinator
