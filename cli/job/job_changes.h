// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MergeChanges: updates a watcher's copy of a job from messages with changes.
#pragma once

#include "sheaf/v1/job.pb.h"

namespace sheaf::cli {

// Updates the job by a message of WatchJob, which has all frames or only changed ones.
void MergeChanges(v1::Job message, v1::Job* job);

}  // namespace sheaf::cli
