// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/grpc_coordinator_link.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "worker/wire/coordinator_messages.h"

namespace sheaf::worker {
namespace {

// Shorter than kUnaryDeadline: a coordinator that hangs must cost less than a lease's lifetime.
constexpr absl::Duration kSynchronizeDeadline = absl::Seconds(10);

std::string TrustedCertificates() {
  const char* const file = std::getenv("AWS_CA_BUNDLE");
  return file == nullptr ? "" : file;
}

// is_stored: the bytes lie in the object store; only the header is sent.
bool WritePart(grpc::ClientWriter<v1::UploadResultsRequest>* writer, const FinishedPart& part,
               const std::string& worker_id, bool is_stored) {
  if (is_stored) {
    v1::UploadResultsRequest request;
    *request.mutable_header() = ToWire(part, worker_id);
    request.mutable_header()->set_stored(true);
    return writer->Write(request);
  }
  v1::UploadResultsRequest request;
  *request.mutable_header() = ToWire(part, worker_id);
  for (size_t offset = 0; offset == 0 || offset < part.exr_bytes.size();
       offset += kStreamChunkBytesMax) {
    const size_t size_bytes = std::min(kStreamChunkBytesMax, part.exr_bytes.size() - offset);
    request.set_chunk(part.exr_bytes.data() + offset, size_bytes);
    if (!writer->Write(request)) return false;
    request.clear_header();
  }
  return true;
}

// The outcomes of a response, one for each result.
template <class Response>
absl::StatusOr<std::vector<UploadOutcome>> OutcomesOf(const Response& response, size_t count) {
  if (static_cast<size_t>(response.outcomes_size()) != count) {
    return absl::InternalError(absl::StrCat("the coordinator returned ", response.outcomes_size(),
                                            " outcomes for ", count, " results"));
  }
  std::vector<UploadOutcome> outcomes;
  for (const int value : response.outcomes()) {
    const absl::StatusOr<UploadOutcome> outcome = FromWire(value);
    if (!outcome.ok()) return outcome.status();
    outcomes.push_back(*outcome);
  }
  return outcomes;
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
      address_(std::move(address)),
      direct_(TrustedCertificates()) {}

absl::StatusOr<DesiredState> GrpcCoordinatorLink::Synchronize(const WorkerState& state) {
  RunningCall call(this, kSynchronizeDeadline);
  v1::SynchronizeResponse response;
  const grpc::Status status = control_->Synchronize(&call.context, ToWire(state), &response);
  if (!status.ok()) return NoCoordinatorAnswers(address_, FromGrpcStatus(status));
  direct_.SetWanted(response.direct_uploads());
  return FromWire(response);
}

absl::StatusOr<std::vector<PutTicket>> GrpcCoordinatorLink::PlanUploads(
    const std::string& worker_id, const std::vector<const FinishedPart*>& parts) {
  RunningCall call(this, kUnaryDeadline);
  v1::PlanUploadsRequest request;
  for (const FinishedPart* part : parts) *request.add_results() = ToWire(*part, worker_id);
  v1::PlanUploadsResponse response;
  const grpc::Status status = data_->PlanUploads(&call.context, request, &response);
  if (!status.ok()) return FromGrpcStatus(status);
  std::vector<PutTicket> tickets;
  for (const v1::UploadTicket& wire : response.tickets()) {
    PutTicket ticket{wire.url(), {}};
    for (const v1::HttpHeader& header : wire.headers()) {
      ticket.headers.emplace_back(header.name(), header.value());
    }
    tickets.push_back(std::move(ticket));
  }
  return tickets;
}

absl::StatusOr<std::vector<UploadOutcome>> GrpcCoordinatorLink::UploadResults(
    const std::string& worker_id, const std::vector<const FinishedPart*>& parts) {
  const std::vector<bool> stored =
      direct_.Store(parts, [this, &worker_id](const std::vector<const FinishedPart*>& planned) {
        return PlanUploads(worker_id, planned);
      });
  RunningCall call(this, kStreamDeadline);
  v1::UploadResultsResponse response;
  const std::unique_ptr<grpc::ClientWriter<v1::UploadResultsRequest>> writer =
      data_->UploadResults(&call.context, &response);
  for (size_t i = 0; i < parts.size(); ++i) {
    // Finish returns the reason of a failure.
    if (!WritePart(writer.get(), *parts[i], worker_id, stored[i])) break;
  }
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  if (status.error_code() == grpc::StatusCode::FAILED_PRECONDITION) {
    direct_.Pause(status.error_message());
  }
  if (!status.ok()) return FromGrpcStatus(status);
  return OutcomesOf(response, parts.size());
}

absl::StatusOr<Delivery> GrpcCoordinatorLink::Deliver(
    const WorkerState& state, const std::vector<const FinishedPart*>& parts) {
  RunningCall call(this, kSynchronizeDeadline);
  v1::DeliverResultsRequest request;
  *request.mutable_state() = ToWire(state);
  for (const FinishedPart* part : parts) {
    v1::DeliveredResult* const result = request.add_results();
    *result->mutable_header() = ToWire(*part, state.worker_id);
    result->set_part(part->exr_bytes);
  }
  v1::DeliverResultsResponse response;
  const grpc::Status status = data_->DeliverResults(&call.context, request, &response);
  if (!status.ok()) return NoCoordinatorAnswers(address_, FromGrpcStatus(status));
  absl::StatusOr<std::vector<UploadOutcome>> outcomes = OutcomesOf(response, parts.size());
  if (!outcomes.ok()) return outcomes.status();
  absl::StatusOr<DesiredState> desired = FromWire(response.desired());
  if (!desired.ok()) return desired.status();
  direct_.SetWanted(response.desired().direct_uploads());
  return Delivery{*std::move(outcomes), *std::move(desired)};
}

void GrpcCoordinatorLink::Abort() {
  direct_.Abort();
  const MutexLock lock(&mutex_);
  aborted_ = true;
  for (grpc::ClientContext* context : running_) context->TryCancel();
}

}  // namespace sheaf::worker
