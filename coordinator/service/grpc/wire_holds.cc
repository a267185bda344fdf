// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Held work (job_holds.h), on the wire.
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "coordinator/core/job/job_approval.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {

absl::Status TakeHolds(const v1::CreateJobRequest& request, JobSpec* spec) {
  for (const v1::JobDependency& wire : request.dependencies()) {
    const absl::StatusOr<std::string> id = ParseJobName(wire.job_name());
    JobDependency dependency{.by_frame = wire.by_frame()};
    if (!id.ok() || !absl::SimpleAtoi(*id, &dependency.job_id)) {
      return absl::InvalidArgumentError(
          absl::StrCat("dependencies: \"", wire.job_name(), "\" is not of the form jobs/ID"));
    }
    spec->dependencies.push_back(dependency);
  }
  return HoldForApproval(request.approve_after_samples(), spec);
}

}  // namespace sheaf::coordinator
