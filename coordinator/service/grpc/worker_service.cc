// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/worker_service.h"

#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"
#include "common/rpc/protocol_calls.h"
#include "coordinator/service/grpc/caller.h"
#include "coordinator/service/grpc/drain_stream.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

constexpr int kPlannedUploadsMax = 16;

v1::UploadResultsResponse::Outcome WireOutcome(ResultOutcome outcome) {
  switch (outcome) {
    case ResultOutcome::kAccepted:
      return v1::UploadResultsResponse::OUTCOME_ACCEPTED;
    case ResultOutcome::kDuplicateEqual:
      return v1::UploadResultsResponse::OUTCOME_DUPLICATE_EQUAL;
    case ResultOutcome::kDuplicateMismatch:
      return v1::UploadResultsResponse::OUTCOME_DUPLICATE_MISMATCH;
    case ResultOutcome::kSuperseded:
      return v1::UploadResultsResponse::OUTCOME_SUPERSEDED;
  }
  return v1::UploadResultsResponse::OUTCOME_UNSPECIFIED;
}

// The report of a header. identity: the sender's, as CallerIdentity says.
absl::StatusOr<ResultReport> ReportOf(const v1::ResultHeader& header, const Farm& farm,
                                      const std::string& identity) {
  absl::StatusOr<ResultReport> report = FromWire(header);
  if (!report.ok()) return report;
  if (report->digest.size_bytes > farm.options().part_bytes_max) {
    return absl::InvalidArgumentError(absl::StrCat("a result of ", report->digest.size_bytes,
                                                   " bytes is larger than ",
                                                   farm.options().part_bytes_max));
  }
  report->identity = identity;
  return report;
}

// Assembles the messages of an upload stream into results, one at a time.
class ResultAssembly {
 public:
  ResultAssembly(Farm* farm, std::string identity, v1::UploadResultsResponse* response)
      : farm_(farm), identity_(std::move(identity)), response_(response) {}

  absl::Status Take(v1::UploadResultsRequest&& message) {
    if (message.has_header()) {
      if (absl::Status status = Finish(); !status.ok()) return status;
      if (response_->outcomes_size() >= kResultsPerUploadMax) {
        return absl::InvalidArgumentError(
            absl::StrCat("more than ", kResultsPerUploadMax, " results in one upload"));
      }
      absl::StatusOr<ResultReport> report = ReportOf(message.header(), *farm_, identity_);
      if (!report.ok()) return report.status();
      report_ = *std::move(report);
    }
    if (!report_) return absl::InvalidArgumentError("the first message has no header");
    if (bytes_.size() + message.chunk().size() > report_->digest.size_bytes) {
      return absl::InvalidArgumentError("more bytes than the header's digest states");
    }
    bytes_ += message.chunk();
    return absl::OkStatus();
  }

  // Gives the current result, if any, to the farm.
  absl::Status Finish() {
    if (!report_) return absl::OkStatus();
    const absl::StatusOr<ResultOutcome> outcome = report_->is_stored
                                                      ? farm_->intake().AddStored(*report_)
                                                      : farm_->intake().Add(*report_, bytes_);
    report_.reset();
    bytes_.clear();
    if (!outcome.ok()) return outcome.status();
    response_->add_outcomes(WireOutcome(*outcome));
    return absl::OkStatus();
  }

 private:
  Farm* farm_;
  const std::string identity_;
  v1::UploadResultsResponse* response_;
  std::optional<ResultReport> report_;
  std::string bytes_;
};

}  // namespace

grpc::Status WorkerService::Synchronize(grpc::ServerContext* context,
                                        const v1::SynchronizeRequest* request,
                                        v1::SynchronizeResponse* response) {
  absl::StatusOr<WorkerReport> report = FromWire(*request);
  if (!report.ok()) return ToGrpcStatus(report.status());
  report->identity = CallerIdentity(*context);
  const absl::StatusOr<Farm::SynchronizeAnswer> answer = farm_->Synchronize(*report);
  if (!answer.ok()) return ToGrpcStatus(answer.status());
  const absl::StatusOr<int> version = ProtocolOfCaller(context->client_metadata());
  if (version.ok()) versions_.Note(report->worker_id, *version);
  *response = ToWire(*answer);
  return grpc::Status::OK;
}

grpc::Status WorkerService::UploadResults(grpc::ServerContext* context,
                                          grpc::ServerReader<v1::UploadResultsRequest>* reader,
                                          v1::UploadResultsResponse* response) {
  const absl::StatusOr<IdentityUse::Stream> stream = OpenStream(*context, access_, "UploadResults");
  if (!stream.ok()) return ToGrpcStatus(stream.status());
  ResultAssembly assembly(farm_, CallerIdentity(*context), response);
  v1::UploadResultsRequest message;
  while (reader->Read(&message)) {
    if (absl::Status status = assembly.Take(std::move(message)); !status.ok()) {
      DrainStream(&message, reader);
      return ToGrpcStatus(status);
    }
  }
  // A broken stream may have ended inside its last result.
  if (context->IsCancelled())
    return ToGrpcStatus(absl::CancelledError("the upload was interrupted"));
  return ToGrpcStatus(assembly.Finish());
}

grpc::Status WorkerService::PlanUploads(grpc::ServerContext* context,
                                        const v1::PlanUploadsRequest* request,
                                        v1::PlanUploadsResponse* response) {
  if (request->results_size() > kPlannedUploadsMax) {
    return ToGrpcStatus(
        absl::InvalidArgumentError(absl::StrCat("results: more than ", kPlannedUploadsMax)));
  }
  const std::string identity = CallerIdentity(*context);
  for (const v1::ResultHeader& header : request->results()) {
    const absl::StatusOr<ResultReport> report = ReportOf(header, *farm_, identity);
    if (!report.ok()) return ToGrpcStatus(report.status());
    const absl::StatusOr<std::optional<PutTicket>> ticket = farm_->intake().TicketFor(*report);
    if (!ticket.ok()) return ToGrpcStatus(ticket.status());
    v1::UploadTicket* const wire = response->add_tickets();
    if (!ticket->has_value()) continue;
    wire->set_url((*ticket)->url);
    for (const auto& [name, value] : (*ticket)->headers) {
      v1::HttpHeader* const to = wire->add_headers();
      to->set_name(name);
      to->set_value(value);
    }
  }
  return grpc::Status::OK;
}

grpc::Status WorkerService::ReadGuidingField(
    grpc::ServerContext* context, const v1::ReadGuidingFieldRequest* request,
    grpc::ServerWriter<v1::ReadGuidingFieldResponse>* writer) {
  const absl::StatusOr<IdentityUse::Stream> stream =
      OpenStream(*context, access_, "ReadGuidingField");
  if (!stream.ok()) return ToGrpcStatus(stream.status());
  const absl::StatusOr<FrameId> id = ParseFrameName(request->frame_name());
  if (!id.ok()) return ToGrpcStatus(id.status());
  const absl::StatusOr<BlobDigest> digest = FromWire(request->digest());
  if (!digest.ok()) return ToGrpcStatus(digest.status());
  const absl::StatusOr<std::string> bytes = farm_->intake().ReadField(*id, *digest);
  if (!bytes.ok()) return ToGrpcStatus(bytes.status());
  for (size_t offset = 0; offset < bytes->size(); offset += kStreamChunkBytesMax) {
    v1::ReadGuidingFieldResponse response;
    response.set_chunk(bytes->substr(offset, kStreamChunkBytesMax));
    if (!writer->Write(response)) break;
  }
  return grpc::Status::OK;
}

}  // namespace sheaf::coordinator
