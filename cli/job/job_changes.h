// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MergeChanges: a job as its watcher knows it, from messages that have what has changed.
#pragma once

#include "sheaf/v1/job.pb.h"

namespace sheaf::cli {

// Brings the job up to date by a message of WatchJob, which has all frames or those that changed.
void MergeChanges(v1::Job message, v1::Job* job);

}  // namespace sheaf::cli
