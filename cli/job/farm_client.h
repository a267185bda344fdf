// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmClient: the coordinator's calls for the commands. Each call is idempotent and is repeated
// while the coordinator does not answer: for a short time before the first answer, for a long time
// after it, so that a restart of the coordinator does not disturb a command. A call beyond the rate
// of calls is repeated as long, after the time that the refusal names; any other refusal fails at
// once.
#pragma once

#include <grpcpp/channel.h>

#include <atomic>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "cli/job/identity/known_jobs.h"
#include "common/content/blob_digest.h"
#include "common/content/chunk_list.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/retry.h"
#include "coordinator/core/job/job_verbs.h"
#include "sheaf/v1/content.grpc.pb.h"
#include "sheaf/v1/job.grpc.pb.h"
#include "sheaf/v1/transfer.grpc.pb.h"

namespace sheaf::cli {

// How long calls are repeated before and after the coordinator's first answer.
inline constexpr absl::Duration kFirstAnswerWait = absl::Seconds(4);
inline constexpr absl::Duration kLaterAnswerWait = absl::Minutes(15);
// The first answer of a submission, so that it outlasts a restart of the coordinator.
inline constexpr absl::Duration kSubmissionAnswerWait = absl::Minutes(1);
inline constexpr size_t kFindMissingMax = 10'000;

// Where a blob's bytes are: in the file at path, or in memory if path is empty.
struct BlobSource {
  BlobDigest digest;
  std::string path;
  std::string bytes;
};

// Thread safety: members may be called concurrently.
class FarmClient {
 public:
  // address is used in messages only. Waits end early when stop is requested.
  FarmClient(std::shared_ptr<grpc::Channel> channel, std::string address, std::stop_token stop,
             absl::Duration first_answer_wait = kFirstAnswerWait);

  // A client of the same farm that ignores the stop request, for calls that must be made after it.
  std::unique_ptr<FarmClient> Uninterrupted() const {
    auto client = std::make_unique<FarmClient>(channel_, address_, std::stop_token());
    client->known_ = known_;
    return client;
  }

  const std::string& address() const { return address_; }
  const std::stop_token& stop() const { return stop_; }

  // Errors of all calls below: those of the call; kUnavailable, naming the address, if the
  // coordinator did not answer for long enough; kCancelled if stop was requested. CreateJob,
  // GetJob, WatchJob and the verbs: also kNotFound if the name now belongs to a job other than the
  // one that this client has seen.
  absl::StatusOr<v1::Job> CreateJob(const v1::CreateJobRequest& request);
  absl::StatusOr<v1::Job> GetJob(const std::string& name);
  absl::StatusOr<v1::CollectGarbageResponse> CollectGarbage(bool dry_run);
  absl::StatusOr<v1::ListUsageResponse> ListUsage(const v1::ListUsageRequest& request);
  absl::StatusOr<std::vector<v1::Worker>> DrainWorkers(const v1::DrainWorkersRequest& request);
  absl::StatusOr<std::vector<v1::Worker>> UndrainWorkers(const v1::UndrainWorkersRequest& request);
  // The verbs of job_verbs.h: PauseJob(request).
#define SHEAF_VERB(call, word, takes)                              \
  absl::StatusOr<v1::Job> call(const v1::call##Request& request) { \
    return ChangeJob(&v1::JobService::Stub::call, request);        \
  }
  SHEAF_JOB_VERBS(SHEAF_VERB)
#undef SHEAF_VERB
  // Calls take with each message; after an interruption the messages restart. Errors: also those of
  // take.
  absl::Status ReadTaskBundle(
      const v1::ReadTaskBundleRequest& request,
      const std::function<absl::Status(const v1::ReadTaskBundleResponse&)>& take);
  absl::StatusOr<v1::PriceRefinementResponse> PriceRefinement(
      const v1::PriceRefinementRequest& request);
  absl::StatusOr<std::vector<v1::Job>> ListJobs(size_t count_max, bool with_pilots = false);
  absl::StatusOr<std::vector<v1::JobEvent>> ListJobEvents(const std::string& name);
  absl::StatusOr<std::vector<v1::Worker>> ListWorkers();
  absl::StatusOr<v1::Share> SetShare(const v1::SetShareRequest& request);
  absl::Status ResetShare(const std::string& subject);
  absl::StatusOr<std::vector<v1::Share>> ListShares();
  // Ends the quarantine of an identity (Worker.identity).
  absl::Status LiftQuarantine(const std::string& identity);
  absl::StatusOr<std::vector<BlobDigest>> FindMissing(const std::vector<BlobDigest>& digests);
  // The delivered EXR. Reads at most size_bytes_max bytes.
  absl::StatusOr<std::string> ReadFrameOutput(const std::string& name, uint64_t size_bytes_max);

  // Calls on_change with the present job and after each change until the job has ended; returns the
  // ended job.
  absl::StatusOr<v1::Job> WatchJob(const std::string& name,
                                   const std::function<void(const v1::Job&)>& on_change);

  // Uploads the rest after an earlier attempt. on_progress gets the number of bytes sent since its
  // last call. Errors: also kFailedPrecondition if the file no longer has its digest.
  absl::Status Upload(const BlobSource& blob, const std::function<void(uint64_t)>& on_progress);
  // The same for several blobs in one call. Requires: they are within the limits of blob_batch.h.
  absl::Status UploadSmall(const std::vector<const BlobSource*>& blobs,
                           const std::function<void(uint64_t)>& on_progress);
  // The same for a large blob; sends only the chunks that the coordinator lacks.
  absl::Status UploadByChunks(const BlobSource& blob,
                              const std::function<void(uint64_t)>& on_progress);

 private:
  template <typename Request, typename Response>
  using Method = grpc::Status (v1::JobService::Stub::*)(grpc::ClientContext*, const Request&,
                                                        Response*);
  // A unary call.
  template <typename Request, typename Response>
  absl::StatusOr<Response> Unary(Method<Request, Response> method, const Request& request) {
    Response response;
    const absl::Status status = Call(
        [&](grpc::ClientContext* context) {
          return FromGrpcStatus((jobs_.get()->*method)(context, request, &response));
        },
        kUnaryDeadline);
    if (!status.ok()) return status;
    return response;
  }
  // The same for a verb: not if the name now belongs to another job.
  template <typename Request>
  absl::StatusOr<v1::Job> ChangeJob(Method<Request, v1::Job> method, const Request& request) {
    const bool seen = known_->Has(request.name());
    absl::Status same = seen ? GetJob(request.name()).status() : absl::OkStatus();
    if (!same.ok()) return same;
    return Unary(method, request);
  }
  // Repeats attempt while it fails with a transient error.
  absl::Status Call(const std::function<absl::Status(grpc::ClientContext*)>& attempt,
                    absl::Duration deadline);
  absl::Status UploadOnce(grpc::ClientContext* context, const BlobSource& blob,
                          uint64_t offset_bytes, const std::function<void(uint64_t)>& on_progress);
  absl::StatusOr<v1::PlanWriteResponse> PlanWrite(const ChunkList& list);
  absl::StatusOr<uint64_t> CommittedBytes(const BlobDigest& digest, bool* complete);

  const std::shared_ptr<grpc::Channel> channel_;
  const std::string address_;
  const std::stop_token stop_;
  const absl::Duration first_answer_wait_;
  const std::unique_ptr<v1::JobService::Stub> jobs_;
  const std::unique_ptr<v1::ContentService::Stub> content_;
  const std::unique_ptr<v1::TransferService::Stub> transfer_;
  const RetryEnvironment environment_;
  std::shared_ptr<KnownJobs> known_ = std::make_shared<KnownJobs>();
  std::atomic<bool> answered_{false};
  std::atomic<bool> silent_{false};   // Whether a lasting outage has been reported.
  std::atomic<bool> limited_{false};  // Whether a rate limit has been reported.
};

// The request of a verb that takes no more than the job: RequestFor<v1::PauseJobRequest>("jobs/7").
template <typename Request>
Request RequestFor(const std::string& name) {
  Request request;
  request.set_name(name);
  return request;
}

// "jobs/7" from "7" or "jobs/7".
std::string JobName(const std::string& text);
bool HasEnded(const v1::Job& job);

}  // namespace sheaf::cli
