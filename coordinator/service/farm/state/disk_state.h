// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DiskState: whether the state directory, and the object store of parts if there is one, can be
// written, according to the last write.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "common/base/mutex.h"
#include "coordinator/service/farm/state/farm_signals.h"
#include "coordinator/store/disk_reserve.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently, under any other lock.
class DiskState {
 public:
  // Both must outlive the object.
  DiskState(FarmSignals* signals, const DiskReserve* reserve)
      : signals_(*signals), reserve_(*reserve) {}

  // Checks that this many bytes may be written in addition to the database's. Errors:
  // DiskReserve::CheckRoom's.
  absl::Status CheckRoom(uint64_t bytes) const { return reserve_.CheckRoom(bytes); }

  // Records the outcome of a write. Ignores errors that are not the disk's.
  void Note(const absl::Status& written);
  // The outcome of the last write: OK, kResourceExhausted, kUnavailable, kPermissionDenied or
  // kDataLoss.
  absl::Status Last() const;

 private:
  FarmSignals& signals_;
  const DiskReserve& reserve_;
  mutable Mutex mutex_;
  absl::Status last_ ABSL_GUARDED_BY(mutex_);
};

// "the coordinator's store is not writable: ...". Requires: `disk` is an error.
std::string WhyWritesWait(const absl::Status& disk);

}  // namespace sheaf::coordinator
