// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ShareControl: the durable settings of operators for users, shows and pools, and their state.
#pragma once

#include <functional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "coordinator/core/job/limits.h"
#include "coordinator/core/job/share_setting.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_signals.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class ShareControl {
 public:
  // All must outlive this.
  struct Parts {
    FarmTables& tables;
    JobStore& store;
    DiskState& disk;
    FarmSignals& signals;
  };
  ShareControl(const Limits& limits, const Parts& parts)
      : limits_(limits),
        tables_(parts.tables),
        store_(parts.store),
        disk_(parts.disk),
        signals_(parts.signals) {}

  // Restores the stored settings into the scheduler. Call once, first. Errors: those of the store.
  absl::Status Load();

  // Changes the setting of a subject, starting from the default if none was set. OK means: it is
  // durable. Errors: kInvalidArgument; kResourceExhausted (too many settings, or the disk);
  // kUnavailable (the disk).
  absl::StatusOr<ShareView> Set(const ShareSubject& subject,
                                const std::function<void(ShareSetting*)>& change)
      ABSL_LOCKS_EXCLUDED(set_mutex_);
  // Removes the setting of the subject. Errors: kUnavailable, kResourceExhausted (the disk).
  absl::Status Reset(const ShareSubject& subject) ABSL_LOCKS_EXCLUDED(set_mutex_);
  // Subjects with a setting or with unfinished jobs; ascending by kind and name.
  std::vector<ShareView> List() const;

 private:
  ShareView ViewOf(const ShareSubject& subject) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);

  const Limits limits_;
  FarmTables& tables_;
  JobStore& store_;
  DiskState& disk_;
  FarmSignals& signals_;
  Mutex set_mutex_;  // One change at a time. Taken before the tables' mutex.
};

}  // namespace sheaf::coordinator
