// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Explains why a job waits.
#pragma once

#include "coordinator/scheduling/work_state.h"

namespace sheaf::coordinator::scheduling {

// As Scheduler has them.
std::string WaitingReason(const WorkState& state, const JobRecord& job);

}  // namespace sheaf::coordinator::scheduling
