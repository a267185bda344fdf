// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkerVersions: logs the workers whose protocol version differs from this coordinator's, so that
// an operator can see which ones to update.
#pragma once

#include <set>
#include <string>

#include "common/base/mutex.h"

namespace sheaf::coordinator {

// Thread safety: may be called from any thread.
class WorkerVersions {
 public:
  // Workers remembered as logged. Beyond the limit they are logged again.
  static constexpr size_t kToldMax = 10'000;

  // The worker speaks this version with the coordinator. Logs it once, if it is not the
  // coordinator's newest. Returns whether it did.
  bool Note(const std::string& worker_id, int version);

 private:
  Mutex mutex_;
  std::set<std::string> told_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::coordinator
