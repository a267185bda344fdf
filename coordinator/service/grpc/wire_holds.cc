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

void AddHolds(const JobView& view, v1::Job* job) {
  job->set_unapproved_frame_count(view.unapproved_frame_count);
  for (const DependencyView& dependency : view.dependencies) {
    v1::JobDependency& wire = *job->add_dependencies();
    wire.set_job_name(absl::StrCat("jobs/", dependency.job_id));
    wire.set_by_frame(dependency.by_frame);
    wire.set_state(dependency.state);
  }
}

}  // namespace sheaf::coordinator
