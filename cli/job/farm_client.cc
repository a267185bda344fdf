// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/farm_client.h"

#include <grpcpp/client_context.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "cli/job/job_changes.h"
#include "cli/job/wire_digest.h"
#include "cli/message.h"
#include "common/base/mutex.h"
#include "common/base/retry_after.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"

namespace sheaf::cli {
namespace {

constexpr int kJobsPageSize = 1000;
// For one attempt at a streaming call; a larger upload or download resumes in the next one.
constexpr absl::Duration kAttemptDeadline = kStreamDeadline;

RetryEnvironment MakeEnvironment(std::stop_token stop) {
  RetryEnvironment environment = SystemRetryEnvironment();
  environment.sleep = [stop](absl::Duration duration) {
    return SleepUnlessStopped(duration, stop);
  };
  return environment;
}

template <typename Response>
absl::StatusOr<std::vector<v1::Worker>> WorkersOf(const absl::StatusOr<Response>& response) {
  if (!response.ok()) return response.status();
  return std::vector<v1::Worker>(response->workers().begin(), response->workers().end());
}

}  // namespace

std::string JobName(const std::string& text) {
  return text.starts_with("jobs/") ? text : absl::StrCat("jobs/", text);
}

bool HasEnded(const v1::Job& job) {
  return job.state() == v1::Job::STATE_SUCCEEDED || job.state() == v1::Job::STATE_FAILED ||
         job.state() == v1::Job::STATE_CANCELLED;
}

FarmClient::FarmClient(std::shared_ptr<grpc::Channel> channel, std::string address,
                       std::stop_token stop, absl::Duration first_answer_wait)
    : channel_(std::move(channel)),
      address_(std::move(address)),
      stop_(stop),
      first_answer_wait_(first_answer_wait),
      jobs_(v1::JobService::NewStub(channel_)),
      content_(v1::ContentService::NewStub(channel_)),
      transfer_(v1::TransferService::NewStub(channel_)),
      environment_(MakeEnvironment(stop)) {}

absl::Status FarmClient::Call(const std::function<absl::Status(grpc::ClientContext*)>& attempt,
                              absl::Duration deadline) {
  RetryPolicy policy;
  policy.elapsed_max = answered_ ? kLaterAnswerWait : first_answer_wait_;
  policy.attempts_max = 10'000;
  // Once for this call: calls within an attempt succeed meanwhile.
  bool told_limited = false, told_silent = false;
  const absl::Status status =
      RetryLoop(policy, Idempotency::kIdempotent, environment_, [&]() -> absl::Status {
        if (stop_.stop_requested()) return absl::CancelledError("interrupted");
        grpc::ClientContext context;
        SetDeadline(&context, deadline);
        const std::stop_callback cancel(stop_, [&context] { context.TryCancel(); });
        absl::Status result = attempt(&context);
        if (stop_.stop_requested()) return absl::CancelledError("interrupted");
        if (result.ok()) answered_ = true;
        if (RetryAfterOf(result) && !std::exchange(told_limited, true) &&
            !limited_.exchange(true)) {
          PrintInfo(absl::StrCat("the coordinator at ", address_,
                                 " lets this call wait: ", result.message()));
        }
        const bool is_told = answered_ || first_answer_wait_ > kFirstAnswerWait;
        if (is_told && absl::IsUnavailable(result) && !std::exchange(told_silent, true) &&
            !silent_.exchange(true)) {
          PrintInfo(absl::StrCat("the coordinator at ", address_,
                                 " does not answer; trying again for up to ",
                                 absl::FormatDuration(policy.elapsed_max)));
        }
        if (result.ok()) silent_ = limited_ = false;
        return result;
      });
  if (stop_.stop_requested() && !status.ok()) return absl::CancelledError("interrupted");
  // The farm has run out of a resource, not the command.
  if (absl::IsResourceExhausted(status)) return absl::FailedPreconditionError(status.message());
  return NoCoordinatorAnswers(address_, status);
}

absl::StatusOr<v1::Job> FarmClient::CreateJob(const v1::CreateJobRequest& request) {
  absl::StatusOr<v1::Job> job = Unary(&v1::JobService::Stub::CreateJob, request);
  if (job.ok()) known_->Note(*job);
  return job;
}

absl::StatusOr<v1::Job> FarmClient::GetJob(const std::string& name) {
  absl::StatusOr<v1::Job> job =
      Unary(&v1::JobService::Stub::GetJob, RequestFor<v1::GetJobRequest>(name));
  if (!job.ok()) return job;
  if (absl::Status same = known_->Check(*job); !same.ok()) return same;
  return job;
}

absl::StatusOr<v1::PriceRefinementResponse> FarmClient::PriceRefinement(
    const v1::PriceRefinementRequest& request) {
  return Unary(&v1::JobService::Stub::PriceRefinement, request);
}

absl::StatusOr<std::vector<v1::Job>> FarmClient::ListJobs(size_t count_max, bool with_pilots) {
  std::vector<v1::Job> jobs;
  v1::ListJobsRequest request;
  request.set_with_pilots(with_pilots);
  do {
    request.set_page_size(static_cast<int>(std::min<size_t>(kJobsPageSize, count_max)));
    absl::StatusOr<v1::ListJobsResponse> response = Unary(&v1::JobService::Stub::ListJobs, request);
    if (!response.ok()) return response.status();
    for (v1::Job& job : *response->mutable_jobs()) {
      if (jobs.size() < count_max) jobs.push_back(std::move(job));
    }
    request.set_page_token(response->next_page_token());
  } while (!request.page_token().empty() && jobs.size() < count_max);
  return jobs;
}

absl::StatusOr<std::vector<v1::JobEvent>> FarmClient::ListJobEvents(const std::string& name) {
  const absl::StatusOr<v1::ListJobEventsResponse> response =
      Unary(&v1::JobService::Stub::ListJobEvents, RequestFor<v1::ListJobEventsRequest>(name));
  if (!response.ok()) return response.status();
  return std::vector<v1::JobEvent>(response->events().begin(), response->events().end());
}

absl::StatusOr<std::vector<v1::Worker>> FarmClient::ListWorkers() {
  return WorkersOf(Unary(&v1::JobService::Stub::ListWorkers, v1::ListWorkersRequest()));
}

absl::StatusOr<std::vector<v1::Worker>> FarmClient::DrainWorkers(
    const v1::DrainWorkersRequest& request) {
  return WorkersOf(Unary(&v1::JobService::Stub::DrainWorkers, request));
}

absl::StatusOr<std::vector<v1::Worker>> FarmClient::UndrainWorkers(
    const v1::UndrainWorkersRequest& request) {
  return WorkersOf(Unary(&v1::JobService::Stub::UndrainWorkers, request));
}

absl::Status FarmClient::LiftQuarantine(const std::string& identity) {
  v1::LiftQuarantineRequest request;
  request.set_identity(identity);
  return Unary(&v1::JobService::Stub::LiftQuarantine, request).status();
}

absl::StatusOr<v1::Share> FarmClient::SetShare(const v1::SetShareRequest& request) {
  return Unary(&v1::JobService::Stub::SetShare, request);
}

absl::Status FarmClient::ResetShare(const std::string& subject) {
  v1::ResetShareRequest request;
  request.set_subject(subject);
  return Unary(&v1::JobService::Stub::ResetShare, request).status();
}

absl::StatusOr<std::vector<v1::Share>> FarmClient::ListShares() {
  const absl::StatusOr<v1::ListSharesResponse> response =
      Unary(&v1::JobService::Stub::ListShares, v1::ListSharesRequest());
  if (!response.ok()) return response.status();
  return std::vector<v1::Share>(response->shares().begin(), response->shares().end());
}

absl::StatusOr<v1::CollectGarbageResponse> FarmClient::CollectGarbage(bool dry_run) {
  v1::CollectGarbageRequest request;
  request.set_dry_run(dry_run);
  return Unary(&v1::JobService::Stub::CollectGarbage, request);
}

absl::StatusOr<v1::ListUsageResponse> FarmClient::ListUsage(const v1::ListUsageRequest& request) {
  return Unary(&v1::JobService::Stub::ListUsage, request);
}

absl::StatusOr<std::vector<BlobDigest>> FarmClient::FindMissing(
    const std::vector<BlobDigest>& digests) {
  std::vector<BlobDigest> missing;
  for (size_t first = 0; first < digests.size(); first += kFindMissingMax) {
    v1::FindMissingRequest request;
    const size_t end = std::min(digests.size(), first + kFindMissingMax);
    for (size_t i = first; i < end; ++i) SetWireDigest(digests[i], request.add_digests());
    v1::FindMissingResponse response;
    const absl::Status status = Call(
        [&](grpc::ClientContext* context) {
          return FromGrpcStatus(content_->FindMissing(context, request, &response));
        },
        kUnaryDeadline);
    if (!status.ok()) return status;
    for (const v1::Digest& digest : response.missing()) {
      missing.push_back({digest.sha256_hex(), digest.size_bytes()});
    }
  }
  return missing;
}

absl::StatusOr<std::string> FarmClient::ReadFrameOutput(const std::string& name,
                                                        uint64_t size_bytes_max) {
  v1::ReadFrameOutputRequest request;
  request.set_name(name);
  std::string bytes;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) -> absl::Status {
        bytes.clear();
        const auto reader = jobs_->ReadFrameOutput(context, request);
        v1::ReadFrameOutputResponse response;
        while (reader->Read(&response)) {
          if (bytes.size() + response.chunk().size() > size_bytes_max) {
            context->TryCancel();
            return absl::OutOfRangeError(
                absl::StrCat(name, ": the image is larger than ", size_bytes_max, " bytes"));
          }
          bytes += response.chunk();
        }
        return FromGrpcStatus(reader->Finish());
      },
      kAttemptDeadline);
  if (!status.ok()) return status;
  return bytes;
}

absl::Status FarmClient::ReadTaskBundle(
    const v1::ReadTaskBundleRequest& request,
    const std::function<absl::Status(const v1::ReadTaskBundleResponse&)>& take) {
  absl::Status taken;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) -> absl::Status {
        const auto reader = jobs_->ReadTaskBundle(context, request);
        v1::ReadTaskBundleResponse response;
        while (taken.ok() && reader->Read(&response)) taken = take(response);
        if (taken.ok()) return FromGrpcStatus(reader->Finish());
        context->TryCancel();
        reader->Finish();
        return absl::AbortedError("the bundle is not taken");  // No attempt changes that.
      },
      kStreamDeadline);
  return taken.ok() ? status : taken;
}

absl::StatusOr<v1::Job> FarmClient::WatchJob(const std::string& name,
                                             const std::function<void(const v1::Job&)>& on_change) {
  v1::WatchJobRequest request;
  request.set_name(name);
  request.set_changes_only(true);
  v1::Job job;
  bool ended = false;
  while (!ended) {
    // A watch that is interrupted after its start counts as a success here, so that the next call
    // waits as long as a new one.
    const absl::Status status = Call(
        [&](grpc::ClientContext* context) -> absl::Status {
          const auto reader = jobs_->WatchJob(context, request);
          bool began = false;
          v1::Job message;
          while (reader->Read(&message)) {
            MergeChanges(std::move(message), &job);
            began = true;
            answered_ = true;
            if (absl::Status same = known_->Check(job); !same.ok()) {
              context->TryCancel();
              reader->Finish();
              return same;
            }
            ended = HasEnded(job);
            on_change(job);
          }
          const absl::Status finished = FromGrpcStatus(reader->Finish());
          const bool may_pass = IsTransient(finished) || absl::IsDeadlineExceeded(finished);
          return ended || (began && may_pass) ? absl::OkStatus() : finished;
        },
        absl::Hours(24));
    if (!status.ok()) return status;
    if (!ended && !environment_.sleep(absl::Milliseconds(200))) {
      return absl::CancelledError("interrupted");
    }
  }
  return job;
}

}  // namespace sheaf::cli
