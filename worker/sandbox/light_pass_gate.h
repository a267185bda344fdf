// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightPassGate: bounds the memory of the light passes that are rendered at the same time. Each
// takes as much as the whole frame, however many threads a worker has.
#pragma once

#include <cstdint>
#include <stop_token>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"

namespace sheaf::worker {

// Thread-safe. Must outlive its passes.
class LightPassGate {
 public:
  explicit LightPassGate(uint64_t bytes_max) : bytes_max_(bytes_max) {}

  // Holds memory as long as it lives.
  class Pass {
   public:
    Pass(Pass&& other) noexcept : gate_(other.gate_), bytes_(other.bytes_) {
      other.gate_ = nullptr;
    }
    Pass& operator=(Pass&&) = delete;
    ~Pass() {
      if (gate_ != nullptr) gate_->Leave(bytes_);
    }

   private:
    friend class LightPassGate;
    Pass(LightPassGate* gate, uint64_t bytes) : gate_(gate), bytes_(bytes) {}
    LightPassGate* gate_;
    uint64_t bytes_;
  };

  // The bytes of the passes that were let in.
  uint64_t bytes() const {
    const MutexLock lock(&mutex_);
    return taken_;
  }
  // Waits until the passes that were let in take at most bytes_max with this one, or there is none.
  // Errors: kCancelled when stop was requested.
  absl::StatusOr<Pass> Enter(uint64_t bytes, std::stop_token stop);

 private:
  void Leave(uint64_t bytes);

  const uint64_t bytes_max_;
  mutable Mutex mutex_;
  CondVar left_;
  uint64_t taken_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace sheaf::worker
