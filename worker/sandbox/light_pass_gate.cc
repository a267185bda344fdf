// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/light_pass_gate.h"

#include <utility>

namespace sheaf::worker {

absl::StatusOr<LightPassGate::Pass> LightPassGate::Enter(uint64_t bytes, std::stop_token stop) {
  const MutexLock lock(&mutex_);
  const auto fits = [this, bytes]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return taken_ == 0 || (taken_ <= bytes_max_ && bytes <= bytes_max_ - taken_);
  };
  if (!left_.Wait(&mutex_, std::move(stop), fits)) {
    return absl::CancelledError("the light pass was stopped while it waited for memory");
  }
  taken_ += bytes;
  return Pass(this, bytes);
}

void LightPassGate::Leave(uint64_t bytes) {
  {
    const MutexLock lock(&mutex_);
    taken_ -= bytes;
  }
  left_.NotifyAll();
}

}  // namespace sheaf::worker
