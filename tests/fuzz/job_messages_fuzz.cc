// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the messages that clients send about jobs. A job that passes all checks
// is scheduled, and what a worker is then sent must be valid for the worker: a coordinator that
// accepts a job which workers refuse loses it.
#include <algorithm>
#include <string>

#include "common/base/steady_time.h"
#include "coordinator/scheduling/scheduler.h"
#include "coordinator/service/grpc/wire.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/small_farm.h"
#include "worker/wire/coordinator_messages.h"

namespace sheaf::coordinator {
namespace {

void Create(std::string_view bytes) {
  v1::CreateJobRequest request;
  if (!request.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
  absl::StatusOr<JobSpec> spec = FromWire(request);
  if (!spec.ok()) return;
  Scheduler scheduler(testing::SmallLimits(), 1);
  testing::CompleteSpec(1, &*spec);
  if (!scheduler.CheckJob(*spec).ok()) return;
  scheduler.AddJob(*spec);
  WorkerReport report;
  report.worker_id = report.host = "a";
  report.numeric_profile = testing::kProfile;
  report.requested_lease_count = 8;
  const absl::StatusOr<Scheduler::SynchronizeAnswer> answer =
      scheduler.Synchronize(report, SteadyTime() + absl::Seconds(1));
  SHEAF_CHECK(answer.ok());
  const v1::SynchronizeResponse wire = ToWire(testing::AnswerOf(scheduler, *answer));
  const absl::StatusOr<worker::DesiredState> desired = worker::FromWire(wire);
  SHEAF_CHECK(desired.ok() && desired->leases.size() == answer->leases.size());
}

void Refine(std::string_view bytes) {
  v1::RefineJobRequest request;
  if (!request.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
  const absl::StatusOr<Refinement> refinement = FromWire(request);
  if (!refinement.ok()) return;
  const StopRule& stop = refinement->stop;
  SHEAF_CHECK(stop.target_error >= 0 && stop.target_error <= kTargetErrorMax);
  SHEAF_CHECK(stop.time_max > absl::ZeroDuration() && stop.cpu_max > absl::ZeroDuration());
}

void Name(std::string_view bytes) {
  const std::string text(bytes);
  const absl::StatusOr<FrameId> frame = ParseFrameName(text);
  if (frame.ok()) {
    const absl::StatusOr<FrameId> again = ParseFrameName(FrameName(*frame));
    SHEAF_CHECK(again.ok() && *again == *frame);
  }
  const absl::StatusOr<std::string> job = ParseJobName(text);
  if (job.ok()) SHEAF_CHECK(!job->empty());
}

}  // namespace

// The first byte selects the message.
SHEAF_FUZZ_TARGET(job_messages) {
  switch (testing::TakeByte(&bytes) % 3) {
    case 0:
      return Create(bytes);
    case 1:
      return Refine(bytes);
    default:
      return Name(bytes);
  }
}

}  // namespace sheaf::coordinator
