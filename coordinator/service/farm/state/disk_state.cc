// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/state/disk_state.h"

#include "absl/strings/str_cat.h"
#include "common/base/log.h"

namespace sheaf::coordinator {

void DiskState::Note(const absl::Status& written) {
  const bool of_disk = absl::IsResourceExhausted(written) || absl::IsUnavailable(written) ||
                       absl::IsPermissionDenied(written) || absl::IsDataLoss(written);
  if (!written.ok() && !of_disk) return;
  const MutexLock lock(&mutex_);
  const bool changed = written.ok() != last_.ok();
  last_ = written;
  if (!changed) return;
  if (written.ok()) {
    LogInfo("the coordinator's store is writable again");
  } else {
    LogError(absl::StrCat(WhyWritesWait(written), "; results are not acknowledged until it is"));
  }
  signals_.Changed();  // The reason why jobs wait.
}

absl::Status DiskState::Last() const {
  const MutexLock lock(&mutex_);
  return last_;
}

std::string WhyWritesWait(const absl::Status& disk) {
  return absl::StrCat("the coordinator's store is not writable: ", disk.message());
}

}  // namespace sheaf::coordinator
