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
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->CreateJob(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  known_->Note(job);
  return job;
}

absl::StatusOr<v1::Job> FarmClient::GetJob(const std::string& name) {
  v1::GetJobRequest request;
  request.set_name(name);
  v1::Job job;
  absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->GetJob(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  if (status = known_->Check(job); !status.ok()) return status;
  return job;
}

absl::StatusOr<v1::Job> FarmClient::CancelJob(const std::string& name) {
  absl::Status same = known_->Has(name) ? GetJob(name).status() : absl::OkStatus();
  if (!same.ok()) return same;
  v1::CancelJobRequest request;
  request.set_name(name);
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->CancelJob(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<v1::Job> FarmClient::PauseJob(const std::string& name) {
  v1::PauseJobRequest request;
  request.set_name(name);
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->PauseJob(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<v1::Job> FarmClient::ResumeJob(const std::string& name) {
  v1::ResumeJobRequest request;
  request.set_name(name);
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->ResumeJob(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<v1::Job> FarmClient::SetJobPriority(const std::string& name, int32_t priority) {
  v1::SetJobPriorityRequest request;
  request.set_name(name);
  request.set_priority(priority);
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->SetJobPriority(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<v1::Job> FarmClient::RefineJob(const v1::RefineJobRequest& request) {
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->RefineJob(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<v1::Job> FarmClient::RetryTasks(const v1::RetryTasksRequest& request) {
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->RetryTasks(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<v1::Job> FarmClient::KillTasks(const v1::KillTasksRequest& request) {
  v1::Job job;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->KillTasks(context, request, &job));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return job;
}

absl::StatusOr<v1::PriceRefinementResponse> FarmClient::PriceRefinement(
    const v1::PriceRefinementRequest& request) {
  v1::PriceRefinementResponse response;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->PriceRefinement(context, request, &response));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return response;
}

absl::StatusOr<std::vector<v1::Job>> FarmClient::ListJobs(size_t count_max, bool with_pilots) {
  std::vector<v1::Job> jobs;
  v1::ListJobsRequest request;
  request.set_with_pilots(with_pilots);
  do {
    request.set_page_size(static_cast<int>(std::min<size_t>(kJobsPageSize, count_max)));
    v1::ListJobsResponse response;
    const absl::Status status = Call(
        [&](grpc::ClientContext* context) {
          return FromGrpcStatus(jobs_->ListJobs(context, request, &response));
        },
        kUnaryDeadline);
    if (!status.ok()) return status;
    for (v1::Job& job : *response.mutable_jobs()) {
      if (jobs.size() < count_max) jobs.push_back(std::move(job));
    }
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty() && jobs.size() < count_max);
  return jobs;
}

absl::StatusOr<std::vector<v1::Worker>> FarmClient::ListWorkers() {
  v1::ListWorkersResponse response;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->ListWorkers(context, v1::ListWorkersRequest(), &response));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return std::vector<v1::Worker>(response.workers().begin(), response.workers().end());
}

absl::Status FarmClient::LiftQuarantine(const std::string& identity) {
  v1::LiftQuarantineRequest request;
  request.set_identity(identity);
  v1::LiftQuarantineResponse response;
  return Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(jobs_->LiftQuarantine(context, request, &response));
      },
      kUnaryDeadline);
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
