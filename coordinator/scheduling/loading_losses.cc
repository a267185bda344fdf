// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/loading_losses.h"

namespace sheaf::coordinator {

bool LoadingLosses::Add(const std::string& worker_id, SteadyTime grant_time, SteadyTime gone_time) {
  if (grant_time < last_gone_time_ || !workers_.insert(worker_id).second) return false;
  last_gone_time_ = gone_time;
  return true;
}

void LoadingLosses::Clear() {
  workers_.clear();
  ForgetTime();
}

}  // namespace sheaf::coordinator
