// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FirstError: the status of work that several threads share: the first error that one of them
// meets.
#pragma once

#include <utility>

#include "absl/status/status.h"
#include "common/base/mutex.h"

namespace sheaf {

// Thread safety: all members may be called concurrently.
class FirstError {
 public:
  // Keeps the first status that is an error.
  void Update(absl::Status status) {
    const MutexLock lock(&mutex_);
    status_.Update(std::move(status));
  }
  absl::Status Get() const {
    const MutexLock lock(&mutex_);
    return status_;
  }

 private:
  mutable Mutex mutex_;
  absl::Status status_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf
