// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MakeDroppedJob: the last step of a scene dropped on the page. It does the same as an upload and
// CreateJob of that user, with the same limits.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "coordinator/access/access_control.h"
#include "coordinator/service/farm/farm.h"
#include "coordinator/service/grpc/job_service.h"
#include "coordinator/service/view/submission_desk.h"
#include "sheaf/v1/submission.pb.h"

namespace sheaf::coordinator {

struct DroppedJobsTo {
  Farm* farm = nullptr;
  JobService* jobs = nullptr;
  AccessControl* access = nullptr;  // Null without certificates.
};

// Stores the blobs of the reply, reading files from the folder, and creates the job for the caller.
// Returns its id. The reply and the files are untrusted. Errors: kPermissionDenied (the caller may
// no longer submit); kInvalidArgument (bytes that their digest does not match, a file outside the
// folder); kResourceExhausted (a limit of the caller); those of CreateJob.
absl::StatusOr<std::string> MakeDroppedJob(const DroppedJobsTo& to, const SubmissionCaller& caller,
                                           const std::string& folder,
                                           const v1::PrepareReply& reply);

}  // namespace sheaf::coordinator
