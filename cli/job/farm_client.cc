// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/farm_client.h"

#include <grpcpp/client_context.h>

#include <algorithm>
#include <fstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "cli/job/job_changes.h"
#include "cli/message.h"
#include "common/base/digest.h"
#include "common/base/mutex.h"
#include "common/base/retry_after.h"
#include "common/content/blob_store.h"
#include "common/content/chunk_codec.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"

namespace sheaf::cli {
namespace {

constexpr int kJobsPageSize = 1000;
// For one attempt at a streaming call; a larger upload or download resumes in the next one.
constexpr absl::Duration kAttemptDeadline = kStreamDeadline;
// Between looks at a file that another client uploads.
constexpr absl::Duration kSharedUploadWait = absl::Seconds(1);

RetryEnvironment MakeEnvironment(std::stop_token stop) {
  RetryEnvironment environment = SystemRetryEnvironment();
  environment.sleep = [stop](absl::Duration duration) {
    return SleepUnlessStopped(duration, stop);
  };
  return environment;
}

void SetDigest(const BlobDigest& digest, v1::Digest* message) {
  message->set_sha256_hex(digest.sha256_hex);
  message->set_size_bytes(digest.size_bytes);
}

// Reads a blob's bytes in order, starting at an offset.
class BlobReader {
 public:
  BlobReader(const BlobSource& blob, uint64_t offset_bytes) : blob_(blob), offset_(offset_bytes) {
    if (blob.path.empty()) return;
    file_.open(blob.path, std::ios::binary);
    file_.seekg(static_cast<std::streamoff>(offset_bytes));
  }
  // Errors: kFailedPrecondition if the file was truncated or became unreadable.
  absl::StatusOr<std::string> Next() {
    std::string bytes;
    const uint64_t size = std::min(kBlobChunkBytesMax, blob_.digest.size_bytes - offset_);
    if (blob_.path.empty()) {
      bytes = blob_.bytes.substr(offset_, size);
    } else {
      bytes.resize(size);
      file_.read(bytes.data(), static_cast<std::streamsize>(size));
      if (static_cast<uint64_t>(file_.gcount()) != size) {
        return absl::FailedPreconditionError(
            absl::StrCat(blob_.path, ": became shorter while it was being uploaded; submit again"));
      }
    }
    offset_ += size;
    return bytes;
  }
  bool AtEnd() const { return offset_ == blob_.digest.size_bytes; }

 private:
  const BlobSource& blob_;
  uint64_t offset_;
  std::ifstream file_;
};

}  // namespace

std::string JobName(const std::string& text) {
  return text.starts_with("jobs/") ? text : absl::StrCat("jobs/", text);
}

bool HasEnded(const v1::Job& job) {
  return job.state() == v1::Job::STATE_SUCCEEDED || job.state() == v1::Job::STATE_FAILED ||
         job.state() == v1::Job::STATE_CANCELLED;
}

FarmClient::FarmClient(std::shared_ptr<grpc::Channel> channel, std::string address,
                       std::stop_token stop)
    : channel_(std::move(channel)),
      address_(std::move(address)),
      stop_(stop),
      jobs_(v1::JobService::NewStub(channel_)),
      content_(v1::ContentService::NewStub(channel_)),
      transfer_(v1::TransferService::NewStub(channel_)),
      environment_(MakeEnvironment(stop)) {}

absl::Status FarmClient::Call(const std::function<absl::Status(grpc::ClientContext*)>& attempt,
                              absl::Duration deadline) {
  RetryPolicy policy;
  policy.elapsed_max = answered_ ? kLaterAnswerWait : kFirstAnswerWait;
  policy.attempts_max = 10'000;
  const absl::Status status =
      RetryLoop(policy, Idempotency::kIdempotent, environment_, [&]() -> absl::Status {
        if (stop_.stop_requested()) return absl::CancelledError("interrupted");
        grpc::ClientContext context;
        SetDeadline(&context, deadline);
        const std::stop_callback cancel(stop_, [&context] { context.TryCancel(); });
        absl::Status result = attempt(&context);
        if (stop_.stop_requested()) return absl::CancelledError("interrupted");
        if (result.ok()) answered_ = true;
        if (RetryAfterOf(result) && !limited_.exchange(true)) {
          PrintInfo(absl::StrCat("the coordinator at ", address_,
                                 " lets this call wait: ", result.message()));
        }
        if (answered_ && absl::IsUnavailable(result) && !silent_.exchange(true)) {
          PrintInfo(
              absl::StrCat("the coordinator at ", address_, " does not answer; trying again"));
        }
        if (result.ok()) silent_ = limited_ = false;
        return result;
      });
  if (stop_.stop_requested() && !status.ok()) return absl::CancelledError("interrupted");
  // The command has not run out of anything: the farm has.
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
    for (size_t i = first; i < end; ++i) SetDigest(digests[i], request.add_digests());
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
    // A watch that breaks off after it has begun counts as a success here, so that the next call
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

absl::StatusOr<uint64_t> FarmClient::CommittedBytes(const BlobDigest& digest, bool* complete) {
  v1::GetWriteStatusRequest request;
  SetDigest(digest, request.mutable_digest());
  v1::GetWriteStatusResponse response;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(content_->GetWriteStatus(context, request, &response));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  *complete = response.complete();
  return response.committed_bytes();
}

absl::Status FarmClient::UploadOnce(grpc::ClientContext* context, const BlobSource& blob,
                                    uint64_t offset_bytes,
                                    const std::function<void(uint64_t)>& on_progress) {
  v1::WriteBlobResponse response;
  const auto writer = content_->WriteBlob(context, &response);
  BlobReader reader(blob, offset_bytes);
  bool first = true;
  do {
    const absl::StatusOr<std::string> bytes = reader.Next();
    if (!bytes.ok()) {
      context->TryCancel();
      writer->Finish();
      return bytes.status();
    }
    v1::WriteBlobRequest request;
    if (first) {
      SetDigest(blob.digest, request.mutable_digest());
      request.set_offset_bytes(offset_bytes);
    }
    first = false;
    request.set_zstd_chunk(CompressChunk(*bytes));
    if (!writer->Write(request)) break;  // Finish says why.
    on_progress(bytes->size());
  } while (!reader.AtEnd());
  writer->WritesDone();
  return FromGrpcStatus(writer->Finish());
}

absl::Status FarmClient::Upload(const BlobSource& blob,
                                const std::function<void(uint64_t)>& on_progress) {
  bool resuming = blob.digest.size_bytes > kBlobChunkBytesMax;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) -> absl::Status {
        uint64_t offset_bytes = 0;
        bool complete = false;
        if (resuming) {
          const absl::StatusOr<uint64_t> committed = CommittedBytes(blob.digest, &complete);
          if (!committed.ok()) return committed.status();
          offset_bytes = *committed;
        }
        resuming = true;  // Any further call is another attempt.
        if (complete) return absl::OkStatus();
        absl::Status sent = UploadOnce(context, blob, offset_bytes, on_progress);
        if (absl::IsAlreadyExists(sent)) return absl::OkStatus();
        // Retry, which queries its progress again.
        if (absl::IsOutOfRange(sent)) {
          return RetryAfterError("another client uploads the same file", kSharedUploadWait);
        }
        return sent;
      },
      kAttemptDeadline);
  if (!absl::IsInvalidArgument(status) || blob.path.empty()) return status;
  const absl::StatusOr<FileDigest> now = Sha256OfFile(blob.path);
  if (!now.ok() || now->sha256_hex != blob.digest.sha256_hex) {
    return absl::FailedPreconditionError(
        absl::StrCat(blob.path, ": changed while it was being uploaded; submit again"));
  }
  return status;
}

}  // namespace sheaf::cli
