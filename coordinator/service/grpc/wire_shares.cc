// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of wire.h that converts shares, and jobs' requirements.
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

void WriteTraits(const WorkerTraits& traits, v1::Worker* wire) {
  wire->set_pool(traits.pool);
  wire->mutable_tags()->Assign(traits.tags.begin(), traits.tags.end());
  wire->set_memory_bytes(traits.memory_bytes);
}

v1::WorkerRequirements ToWire(const Requirements& requirements) {
  v1::WorkerRequirements wire;
  wire.set_pool(requirements.pool);
  wire.mutable_tags()->Assign(requirements.tags.begin(), requirements.tags.end());
  wire.set_memory_min_bytes(requirements.memory_min_bytes);
  wire.set_memory_expected_bytes(requirements.memory_expected_bytes);
  return wire;
}

v1::Share ToWire(const ShareView& view) {
  v1::Share wire;
  wire.set_subject(FormatShareSubject(view.subject));
  wire.set_weight(view.setting.weight);
  wire.set_threads_max(view.setting.threads_max);
  wire.set_is_set(view.is_set);
  wire.set_job_count(view.job_count);
  wire.set_threads_held(view.threads_held);
  return wire;
}

}  // namespace sheaf::coordinator
