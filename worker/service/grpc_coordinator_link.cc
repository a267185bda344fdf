// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/grpc_coordinator_link.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "worker/wire/coordinator_messages.h"

namespace sheaf::worker {
namespace {

// Shorter than kUnaryDeadline: a coordinator that hangs must cost less than a lease's lifetime.
constexpr absl::Duration kSynchronizeDeadline = absl::Seconds(10);

bool WritePart(grpc::ClientWriter<v1::UploadResultsRequest>* writer, const FinishedPart& part,
               const std::string& worker_id) {
  for (size_t offset = 0; offset == 0 || offset < part.exr_bytes.size();
       offset += kStreamChunkBytesMax) {
    v1::UploadResultsRequest request;
    if (offset == 0) *request.mutable_header() = ToWire(part, worker_id);
    request.set_chunk(part.exr_bytes.substr(offset, kStreamChunkBytesMax));
    if (!writer->Write(request)) return false;
  }
  return true;
}

}  // namespace

class GrpcCoordinatorLink::RunningCall {
 public:
  RunningCall(GrpcCoordinatorLink* link, absl::Duration deadline) : link_(link) {
    SetDeadline(&context, deadline);
    const MutexLock lock(&link_->mutex_);
    link_->running_.insert(&context);
    if (link_->aborted_) context.TryCancel();
  }
  ~RunningCall() {
    const MutexLock lock(&link_->mutex_);
    link_->running_.erase(&context);
  }
  RunningCall(const RunningCall&) = delete;
  RunningCall& operator=(const RunningCall&) = delete;

  grpc::ClientContext context;

 private:
  GrpcCoordinatorLink* link_;
};

GrpcCoordinatorLink::GrpcCoordinatorLink(const std::shared_ptr<grpc::Channel>& control,
                                         const std::shared_ptr<grpc::Channel>& data,
                                         std::string address)
    : control_(v1::WorkerService::NewStub(control)),
      data_(v1::WorkerService::NewStub(data)),
      address_(std::move(address)) {}

absl::StatusOr<DesiredState> GrpcCoordinatorLink::Synchronize(const WorkerState& state) {
  RunningCall call(this, kSynchronizeDeadline);
  v1::SynchronizeResponse response;
  const grpc::Status status = control_->Synchronize(&call.context, ToWire(state), &response);
  if (!status.ok()) return NoCoordinatorAnswers(address_, FromGrpcStatus(status));
  return FromWire(response);
}

absl::StatusOr<std::vector<UploadOutcome>> GrpcCoordinatorLink::UploadResults(
    const std::string& worker_id, const std::vector<const FinishedPart*>& parts) {
  RunningCall call(this, kStreamDeadline);
  v1::UploadResultsResponse response;
  const std::unique_ptr<grpc::ClientWriter<v1::UploadResultsRequest>> writer =
      data_->UploadResults(&call.context, &response);
  for (const FinishedPart* part : parts) {
    if (!WritePart(writer.get(), *part, worker_id)) break;  // Finish returns the reason.
  }
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  if (!status.ok()) return FromGrpcStatus(status);
  if (static_cast<size_t>(response.outcomes_size()) != parts.size()) {
    return absl::InternalError(absl::StrCat("the coordinator returned ", response.outcomes_size(),
                                            " outcomes for ", parts.size(), " results"));
  }
  std::vector<UploadOutcome> outcomes;
  for (const int value : response.outcomes()) {
    const absl::StatusOr<UploadOutcome> outcome = FromWire(value);
    if (!outcome.ok()) return outcome.status();
    outcomes.push_back(*outcome);
  }
  return outcomes;
}

void GrpcCoordinatorLink::Abort() {
  const MutexLock lock(&mutex_);
  aborted_ = true;
  for (grpc::ClientContext* context : running_) context->TryCancel();
}

}  // namespace sheaf::worker
