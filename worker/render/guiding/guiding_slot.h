// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GuidingSlot: holds the learned fields of a compiled scene, which are learned, or received, after
// the scene was compiled. Thread-safe.
#pragma once

#include <atomic>
#include <memory>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "worker/render/guiding/learned_fields.h"

namespace sheaf::render {

class GuidingSlot {
 public:
  // Null before they are set.
  const LearnedFields* fields() const { return fields_.load(std::memory_order_acquire); }

  // Sets the fields to what learn() returns, a StatusOr<LearnedFields>, unless there are some: all
  // that a scene can get are equal. Calls from other threads wait meanwhile. Errors: those of
  // learn.
  template <typename Learn>
  absl::Status SetOnce(const Learn& learn) {
    const MutexLock lock(&mutex_);
    if (owned_ != nullptr) return absl::OkStatus();
    absl::StatusOr<LearnedFields> fields = learn();
    if (!fields.ok()) return fields.status();
    owned_ = std::make_unique<const LearnedFields>(*std::move(fields));
    fields_.store(owned_.get(), std::memory_order_release);
    return absl::OkStatus();
  }

 private:
  Mutex mutex_;
  std::unique_ptr<const LearnedFields> owned_ ABSL_GUARDED_BY(mutex_);
  std::atomic<const LearnedFields*> fields_ = nullptr;
};

}  // namespace sheaf::render
