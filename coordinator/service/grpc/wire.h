// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The one place where requests are checked and become the coordinator's values: code behind this
// file sees only valid values. Views become messages in view/messages.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "coordinator/core/job/job_verbs.h"
#include "coordinator/service/farm/farm.h"
#include "coordinator/service/view/messages/view_messages.h"
#include "sheaf/v1/job.pb.h"
#include "sheaf/v1/worker.pb.h"

namespace sheaf::coordinator {

// Limits of requests.
inline constexpr size_t kTitleBytesMax = 1000;
inline constexpr size_t kCommandBytesMax = 4000;
inline constexpr size_t kRequestIdBytesMax = 100;
inline constexpr size_t kWorkerTextBytesMax = 300;
inline constexpr size_t kFailureTextBytesMax = 10'000;
inline constexpr int kLeaseReportsMax = 10'000;
inline constexpr int kEffectCostsMax = 64;
inline constexpr size_t kEffectTextBytesMax = 1000;
// The maximum cost of one result, so that sums over a job's results stay in range.
inline constexpr uint64_t kResultRaysMax = uint64_t{1} << 48;
inline constexpr absl::Duration kResultCpuMax = absl::Hours(24 * 36525);
inline constexpr absl::Duration kStopDurationMax = absl::Hours(24 * 36525);

// Errors of all FromWire: kInvalidArgument, naming the field.
absl::StatusOr<BlobDigest> FromWire(const v1::Digest& digest);
// Without job id, profile and frame digests, which the farm fills in.
absl::StatusOr<JobSpec> FromWire(const v1::CreateJobRequest& request);
absl::StatusOr<Refinement> FromWire(const v1::RefineJobRequest& request);
// The arguments of a verb's request (job_verbs.h).
template <typename Request>
absl::StatusOr<JobArguments> ArgumentsOf(const Request& request) {
  JobArguments arguments;
  if constexpr (requires { request.priority(); }) arguments.priority = request.priority();
  if constexpr (requires { request.has_frame_number(); }) {
    if (request.has_frame_number()) arguments.frame = request.frame_number();
  } else if constexpr (requires { request.frame_number(); }) {
    arguments.frame = request.frame_number();
  }
  if constexpr (requires { request.has_task(); }) {
    if (request.has_task()) arguments.task = request.task();
    if (arguments.task && !arguments.frame) {
      return absl::InvalidArgumentError("task: needs the frame_number, too");
    }
  }
  if constexpr (requires { request.frame_numbers(); }) {
    arguments.frames.assign(request.frame_numbers().begin(), request.frame_numbers().end());
  }
  if constexpr (requires { request.stop(); }) {
    const absl::StatusOr<Refinement> refinement = FromWire(request);
    if (!refinement.ok()) return refinement.status();
    arguments.refinement = *refinement;
  }
  return arguments;
}
absl::StatusOr<WorkerReport> FromWire(const v1::SynchronizeRequest& request);
absl::StatusOr<ResultReport> FromWire(const v1::ResultHeader& header);

// In wire_effects.cc. Errors: kInvalidArgument.
absl::StatusOr<EffectCost> FromWire(const v1::EffectCost& wire);
// In wire_holds.cc. Reads the holds of the new job. Errors: kInvalidArgument.
absl::Status TakeHolds(const v1::CreateJobRequest& request, JobSpec* spec);
// In wire_deadline.cc. Errors: kInvalidArgument.
absl::Status ReadDeadline(const v1::CreateJobRequest& request, JobSpec* spec);
// In wire_shares.cc, these two. Errors: kInvalidArgument.
absl::Status ReadSharing(const v1::CreateJobRequest& request, JobSpec* spec);
absl::Status ReadTraits(const v1::SynchronizeRequest& request, WorkerTraits* traits);
v1::SynchronizeResponse ToWire(const Farm::SynchronizeAnswer& answer);
v1::Digest ToWire(const BlobDigest& digest);

// "jobs/7" to "7". Errors: kInvalidArgument.
absl::StatusOr<std::string> ParseJobName(const std::string& name);
// "jobs/7/frames/12". Errors: kInvalidArgument.
absl::StatusOr<FrameId> ParseFrameName(const std::string& name);
std::string FrameName(const FrameId& id);

}  // namespace sheaf::coordinator
