// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The one place where wire messages and the coordinator's values are converted. Messages are
// checked here; code behind this file sees only valid values.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "coordinator/service/farm/farm.h"
#include "sheaf/v1/job.pb.h"
#include "sheaf/v1/worker.pb.h"

namespace sheaf::coordinator {

// Limits of requests.
inline constexpr size_t kTitleBytesMax = 1000;
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
absl::StatusOr<WorkerReport> FromWire(const v1::SynchronizeRequest& request);
absl::StatusOr<ResultReport> FromWire(const v1::ResultHeader& header);

v1::Job ToWire(const JobView& view);
// In wire_prices.cc, these three. Errors: kInvalidArgument.
absl::StatusOr<EffectCost> FromWire(const v1::EffectCost& wire);
v1::EffectCost ToWire(const EffectCost& effect);
v1::PriceRefinementResponse ToWire(const RefinementPrices& priced);
// In wire_troubles.cc. Adds the frame's, if it has any.
void AddTroubles(const FrameView& view, v1::Job* job);
// In wire_holds.cc, these two. Reads the holds of the new job. Errors: kInvalidArgument.
absl::Status TakeHolds(const v1::CreateJobRequest& request, JobSpec* spec);
void AddHolds(const JobView& view, v1::Job* job);
// In wire_deadline.cc, these two. Errors: kInvalidArgument.
absl::Status ReadDeadline(const v1::CreateJobRequest& request, JobSpec* spec);
void AddDeadline(const JobView& view, v1::Job* job);
v1::Worker ToWire(const WorkerView& view);
// In wire_shares.cc, these five. Errors: kInvalidArgument.
absl::Status ReadSharing(const v1::CreateJobRequest& request, JobSpec* spec);
absl::Status ReadTraits(const v1::SynchronizeRequest& request, WorkerTraits* traits);
void WriteTraits(const WorkerTraits& traits, v1::Worker* wire);
v1::WorkerRequirements ToWire(const Requirements& requirements);
v1::Share ToWire(const ShareView& view);
v1::SynchronizeResponse ToWire(const Farm::SynchronizeAnswer& answer);
v1::Digest ToWire(const BlobDigest& digest);
v1::RecordedFailure ToWire(const TaskFailure& failure);

// "jobs/7" to "7". Errors: kInvalidArgument.
absl::StatusOr<std::string> ParseJobName(const std::string& name);
// "jobs/7/frames/12". Errors: kInvalidArgument.
absl::StatusOr<FrameId> ParseFrameName(const std::string& name);
std::string FrameName(const FrameId& id);

}  // namespace sheaf::coordinator
