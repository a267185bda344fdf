// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/worker_service.h"

#include <optional>
#include <string>
#include <utility>
#include <vector>

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

using Outcomes = google::protobuf::RepeatedField<int>;

// Results of one call that the farm takes together, so that they become durable at once.
class ResultGroup {
 public:
  // The bytes that wait for the others of the group, at most.
  static constexpr size_t kBytesMax = kDeliveryBytesMax;

  ResultGroup(Farm* farm, Outcomes* outcomes) : farm_(farm), outcomes_(outcomes) {}

  absl::Status Add(ResultReport report, std::string bytes) {
    if (report.is_stored) {
      if (absl::Status taken = TakeAll(); !taken.ok()) return taken;
      return Note(farm_->intake().AddStored(report));
    }
    size_bytes_ += bytes.size();
    reports_.push_back(std::move(report));
    bytes_.push_back(std::move(bytes));
    const bool is_full = size_bytes_ >= kBytesMax || reports_.size() >= kResultsPerDeliveryMax;
    return is_full ? TakeAll() : absl::OkStatus();
  }
  // Gives the waiting results to the farm. Errors: that of the first one that is not taken.
  absl::Status TakeAll() {
    std::vector<ResultIntake::Arrived> arrived;
    for (size_t i = 0; i < reports_.size(); ++i) arrived.push_back({&reports_[i], &bytes_[i]});
    const std::vector<absl::StatusOr<ResultOutcome>> outcomes = farm_->intake().AddGroup(arrived);
    reports_.clear();
    bytes_.clear();
    size_bytes_ = 0;
    for (const absl::StatusOr<ResultOutcome>& outcome : outcomes) {
      if (absl::Status noted = Note(outcome); !noted.ok()) return noted;
    }
    return absl::OkStatus();
  }

 private:
  absl::Status Note(const absl::StatusOr<ResultOutcome>& outcome) {
    if (!outcome.ok()) return outcome.status();
    outcomes_->Add(WireOutcome(*outcome));
    return absl::OkStatus();
  }

  Farm* const farm_;
  Outcomes* const outcomes_;
  std::vector<ResultReport> reports_;
  std::vector<std::string> bytes_;
  size_t size_bytes_ = 0;
};

// Assembles the messages of an upload stream into results.
class ResultAssembly {
 public:
  ResultAssembly(Farm* farm, std::string identity, v1::UploadResultsResponse* response)
      : farm_(farm), identity_(std::move(identity)), group_(farm, response->mutable_outcomes()) {}

  absl::Status Take(v1::UploadResultsRequest&& message) {
    if (message.has_header()) {
      if (absl::Status status = FinishOne(); !status.ok()) return status;
      if (++count_ > kResultsPerUploadMax) {
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
    if (bytes_.empty()) {
      bytes_.swap(*message.mutable_chunk());
    } else {
      bytes_.append(message.chunk());
    }
    return absl::OkStatus();
  }

  // Ends the stream: gives what is left to the farm.
  absl::Status Finish() {
    absl::Status status = FinishOne();
    return status.ok() ? group_.TakeAll() : status;
  }

 private:
  absl::Status FinishOne() {
    if (!report_) return absl::OkStatus();
    absl::Status status = group_.Add(*std::move(report_), std::move(bytes_));
    report_.reset();
    bytes_.clear();
    return status;
  }

  Farm* farm_;
  const std::string identity_;
  ResultGroup group_;
  int count_ = 0;
  std::optional<ResultReport> report_;
  std::string bytes_;
};

// Checks the size of a delivery.
absl::Status CheckDelivery(const v1::DeliverResultsRequest& request) {
  size_t bytes = 0;
  for (const v1::DeliveredResult& result : request.results()) {
    bytes += result.part().size();
    if (result.header().stored()) return absl::InvalidArgumentError("a stored result has no bytes");
  }
  if (request.results_size() <= kResultsPerDeliveryMax && bytes <= kDeliveryBytesMax) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat("more than ", kResultsPerDeliveryMax,
                                                 " results or ", kDeliveryBytesMax,
                                                 " bytes in one delivery"));
}

}  // namespace

absl::Status WorkerService::TakeState(const grpc::ServerContext& context,
                                      const v1::SynchronizeRequest& request,
                                      v1::SynchronizeResponse* response) {
  absl::StatusOr<WorkerReport> report = FromWire(request);
  if (!report.ok()) return report.status();
  report->identity = CallerIdentity(context);
  const std::string worker_id = report->worker_id;
  const absl::StatusOr<Farm::SynchronizeAnswer> answer = farm_->Synchronize(*std::move(report));
  if (!answer.ok()) return answer.status();
  const absl::StatusOr<int> version = ProtocolOfCaller(context.client_metadata());
  if (version.ok()) versions_.Note(worker_id, *version);
  *response = ToWire(*answer);
  return absl::OkStatus();
}

grpc::Status WorkerService::Synchronize(grpc::ServerContext* context,
                                        const v1::SynchronizeRequest* request,
                                        v1::SynchronizeResponse* response) {
  return ToGrpcStatus(TakeState(*context, *request, response));
}

grpc::Status WorkerService::DeliverResults(grpc::ServerContext* context,
                                           const v1::DeliverResultsRequest* request,
                                           v1::DeliverResultsResponse* response) {
  if (absl::Status status = CheckDelivery(*request); !status.ok()) return ToGrpcStatus(status);
  const std::string identity = CallerIdentity(*context);
  std::vector<ResultReport> reports;
  for (const v1::DeliveredResult& result : request->results()) {
    absl::StatusOr<ResultReport> report = ReportOf(result.header(), *farm_, identity);
    if (!report.ok()) return ToGrpcStatus(report.status());
    reports.push_back(*std::move(report));
  }
  std::vector<ResultIntake::Arrived> arrived;
  for (size_t i = 0; i < reports.size(); ++i) {
    arrived.push_back({&reports[i], &request->results(static_cast<int>(i)).part()});
  }
  for (const absl::StatusOr<ResultOutcome>& outcome : farm_->intake().AddGroup(arrived)) {
    if (!outcome.ok()) return ToGrpcStatus(outcome.status());
    response->add_outcomes(WireOutcome(*outcome));
  }
  if (!request->has_state()) return grpc::Status::OK;
  return ToGrpcStatus(TakeState(*context, request->state(), response->mutable_desired()));
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
