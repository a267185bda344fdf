// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of wire.h that reads requirements of jobs, and traits of workers.
#include "common/base/label.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {

absl::Status ReadSharing(const v1::CreateJobRequest& request, JobSpec* spec) {
  if (!request.show().empty()) spec->show = request.show();
  if (const std::string why = WhyNoLabel(spec->show); !why.empty()) {
    return absl::InvalidArgumentError("show: " + why);
  }
  const v1::WorkerRequirements& wire = request.requirements();
  Requirements& requirements = spec->requirements;
  if (!wire.pool().empty()) requirements.pool = wire.pool();
  requirements.tags = SortedTags({wire.tags().begin(), wire.tags().end()});
  requirements.memory_min_bytes = wire.memory_min_bytes();
  requirements.memory_expected_bytes = wire.memory_expected_bytes();
  return CheckRequirements(requirements);
}

absl::Status ReadTraits(const v1::SynchronizeRequest& request, WorkerTraits* traits) {
  if (!request.pool().empty()) traits->pool = request.pool();
  traits->tags = SortedTags({request.tags().begin(), request.tags().end()});
  traits->memory_bytes = request.memory_bytes();
  return CheckWorkerTraits(*traits);
}

}  // namespace sheaf::coordinator
