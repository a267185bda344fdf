// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DiskState: whether the state directory, and the object store where parts lie in one, can be
// written, as the last write found it.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "common/base/mutex.h"
#include "coordinator/service/farm/farm_signals.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently, under any other lock.
class DiskState {
 public:
  // `signals` must outlive the object.
  explicit DiskState(FarmSignals* signals) : signals_(*signals) {}

  // Notes the outcome of a write. Errors that are not the disk's are ignored.
  void Note(const absl::Status& written);
  // The outcome of the last write: OK, kResourceExhausted, kUnavailable, kPermissionDenied or
  // kDataLoss.
  absl::Status Last() const;

 private:
  FarmSignals& signals_;
  mutable Mutex mutex_;
  absl::Status last_ ABSL_GUARDED_BY(mutex_);
};

// "the coordinator's store is not writable: ...". Requires: `disk` is an error.
std::string WhyWritesWait(const absl::Status& disk);

}  // namespace sheaf::coordinator
