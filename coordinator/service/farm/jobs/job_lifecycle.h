// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobLifecycle: jobs from their creation to their durable end, for callers that have a verb. Others
// take the class of what they do.
#pragma once

#include "coordinator/service/farm/jobs/job_continuation.h"
#include "coordinator/service/farm/jobs/job_control.h"
#include "coordinator/service/farm/jobs/job_correction.h"
#include "coordinator/service/farm/jobs/job_ends.h"
#include "coordinator/service/farm/jobs/job_removal.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class JobLifecycle : public JobEnds,
                     public JobControl,
                     public JobContinuation,
                     public JobCorrection,
                     public JobRemoval {
 public:
  // The context must outlive it.
  explicit JobLifecycle(JobContext& context)
      : JobEnds(context),
        JobControl(context, *this),
        JobContinuation(context),
        JobCorrection(context, *this),
        JobRemoval(context) {}
};

}  // namespace sheaf::coordinator
