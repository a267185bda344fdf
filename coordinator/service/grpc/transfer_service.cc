// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/transfer_service.h"

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/string_view.h"
#include "common/base/digest.h"
#include "common/content/blob_batch.h"
#include "common/content/chunk_codec.h"
#include "common/content/chunked_write.h"
#include "common/rpc/address.h"
#include "common/rpc/chunk_list_codec.h"
#include "common/rpc/grpc_status.h"
#include "coordinator/service/grpc/caller.h"
#include "coordinator/service/grpc/drain_stream.h"
#include "coordinator/service/grpc/upload_use.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

constexpr size_t kWorkerIdBytesMax = 256;

absl::Status CheckWorkerId(const std::string& worker_id) {
  if (!worker_id.empty() && worker_id.size() <= kWorkerIdBytesMax) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("worker_id: required, of at most ", kWorkerIdBytesMax, " bytes"));
}

absl::Status CheckBlobName(const std::string& name) { return CheckDigest({name, 0}); }

absl::Status CheckCount(const char* field, int count, int count_max) {
  if (count <= count_max) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(field, ": ", count, " are more than the limit of ", count_max));
}

// "192.0.2.7:PORT" for a caller at "ipv4:192.0.2.7"; empty for one that has no address of its own.
std::string PeerAddress(const grpc::ServerContext& context, uint32_t port) {
  std::string host = CallerAddress(context);
  if (port == 0 || port > 65535) return "";
  const bool is_ipv6 = host.starts_with("ipv6:");
  if (!is_ipv6 && !host.starts_with("ipv4:")) return "";
  host = absl::StrReplaceAll(host.substr(5), {{"%5B", ""}, {"%5D", ""}, {"[", ""}, {"]", ""}});
  return FormatAddress({host, static_cast<uint16_t>(port)});
}

absl::StatusOr<PeerTroubleReport> FromWire(const v1::PeerTrouble& wire) {
  if (absl::Status status = CheckWorkerId(wire.worker_id()); !status.ok()) return status;
  if (absl::Status status = CheckBlobName(wire.sha256_hex()); !status.ok()) return status;
  switch (wire.kind()) {
    case v1::PeerTrouble::KIND_UNREACHABLE:
      return PeerTroubleReport{wire.worker_id(), wire.sha256_hex(), PeerTroubleKind::kUnreachable};
    case v1::PeerTrouble::KIND_REFUSED:
      return PeerTroubleReport{wire.worker_id(), wire.sha256_hex(), PeerTroubleKind::kRefused};
    case v1::PeerTrouble::KIND_WRONG_BYTES:
      return PeerTroubleReport{wire.worker_id(), wire.sha256_hex(), PeerTroubleKind::kWrongBytes};
    case v1::PeerTrouble::KIND_MISSING:
      return PeerTroubleReport{wire.worker_id(), wire.sha256_hex(), PeerTroubleKind::kMissing};
    default:
      return absl::InvalidArgumentError("troubles: a kind that is not known");
  }
}

ContentCounts FromWire(const v1::ContentCounts& wire) {
  return {wire.cache_blobs(),          wire.cache_bytes(),          wire.peer_blobs(),
          wire.peer_bytes(),           wire.coordinator_blobs(),    wire.coordinator_bytes(),
          wire.served_bytes(),         wire.volume_pages_found(),   wire.volume_pages_read(),
          wire.volume_read_bytes(),    wire.volume_pages_evicted(), wire.volume_part_bytes(),
          wire.volume_resident_bytes()};
}

absl::StatusOr<ContentReport> FromWire(const v1::ReportContentRequest& request) {
  absl::Status checked = CheckWorkerId(request.worker_id());
  checked.Update(CheckCount("held", request.held_size(), kReportedBlobsMax));
  checked.Update(CheckCount("fetching", request.fetching_size(), kReportedFetchesMax));
  checked.Update(CheckCount("troubles", request.troubles_size(), kReportedTroublesMax));
  if (!checked.ok()) return checked;
  ContentReport report;
  report.held.assign(request.held().begin(), request.held().end());
  report.fetching.assign(request.fetching().begin(), request.fetching().end());
  for (const std::vector<std::string>* names : {&report.held, &report.fetching}) {
    for (const std::string& name : *names) {
      if (absl::Status status = CheckBlobName(name); !status.ok()) return status;
    }
  }
  for (const v1::PeerTrouble& wire : request.troubles()) {
    absl::StatusOr<PeerTroubleReport> trouble = FromWire(wire);
    if (!trouble.ok()) return trouble.status();
    report.troubles.push_back(*std::move(trouble));
  }
  report.counts = FromWire(request.counts());
  return report;
}

// Reads the chunks of an upload; those before an error or a broken stream stay.
absl::Status WriteAll(grpc::ServerReader<v1::WriteChunksRequest>* reader,
                      v1::WriteChunksRequest* message, ChunkedWrite* write, UploadClaim* claim,
                      uint64_t* received) {
  while (reader->Read(message)) {
    const uint64_t before = write->committed_bytes();
    const absl::StatusOr<std::string> bytes =
        DecompressChunk(message->zstd_chunk(), kChunkBytesMax);
    absl::Status status = bytes.ok() ? write->Append(message->index(), *bytes) : bytes.status();
    claim->NoteWritten(write->committed_bytes() - before);
    if (!status.ok()) {
      write->Flush().IgnoreError();
      return status;
    }
    *received += bytes->size();
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status TransferService::WriteSmall(const grpc::ServerContext& context,
                                         const v1::WriteSmallBlobsRequest& request) {
  absl::Status counted =
      CheckCount("digests", request.digests_size(), static_cast<int>(kSmallBlobsMax));
  if (!counted.ok()) return counted;
  std::vector<BlobDigest> digests;
  for (const v1::Digest& wire : request.digests()) {
    absl::StatusOr<BlobDigest> digest = FromWire(wire);
    if (!digest.ok()) return digest.status();
    digests.push_back(*std::move(digest));
  }
  const absl::StatusOr<std::string> bytes =
      DecompressChunk(request.zstd_bytes(), kSmallBlobsBytesMax);
  if (!bytes.ok()) return bytes.status();
  const absl::StatusOr<UploadClaim> claim =
      BeginUpload(context, farm_, access_, "WriteSmallBlobs", "", bytes->size());
  if (!claim.ok()) return claim.status();
  absl::Status status = PutSmallBlobs(*blobs_, digests, *bytes);
  if (status.ok()) {
    for (const BlobDigest& digest : digests) {
      NoteUpload(context, farm_, digest, digest.size_bytes);
    }
  } else {
    ReturnUpload(context, access_, bytes->size());
  }
  return OfSharedUpload(status);
}

grpc::Status TransferService::WriteSmallBlobs(grpc::ServerContext* context,
                                              const v1::WriteSmallBlobsRequest* request,
                                              v1::WriteSmallBlobsResponse* /*response*/) {
  return ToGrpcStatus(WriteSmall(*context, *request));
}

grpc::Status TransferService::PlanWrite(grpc::ServerContext* /*context*/,
                                        const v1::PlanWriteRequest* request,
                                        v1::PlanWriteResponse* response) {
  const absl::StatusOr<ChunkList> list = ChunkListFromWire(request->digest(), request->chunks());
  if (!list.ok()) return ToGrpcStatus(list.status());
  const absl::StatusOr<ChunkPlan> plan = PlanChunks(*blobs_, &content_->chunks(), *list);
  if (!plan.ok()) return ToGrpcStatus(plan.status());
  response->set_complete(plan->complete);
  response->set_offset_bytes(plan->offset_bytes);
  for (const size_t index : plan->missing) response->add_missing(static_cast<uint32_t>(index));
  return grpc::Status::OK;
}

grpc::Status TransferService::WriteChunks(grpc::ServerContext* context,
                                          grpc::ServerReader<v1::WriteChunksRequest>* reader,
                                          v1::WriteChunksResponse* response) {
  const absl::StatusOr<IdentityUse::Stream> stream = OpenStream(*context, access_, "WriteChunks");
  if (!stream.ok()) return ToGrpcStatus(stream.status());
  v1::WriteChunksRequest message;
  if (!reader->Read(&message) || !message.has_digest()) {
    return ToGrpcStatus(absl::InvalidArgumentError("the first message has no digest"));
  }
  const auto finish = [&](const absl::Status& status) {
    DrainStream(&message, reader);
    return ToGrpcStatus(status);
  };
  const absl::StatusOr<ChunkList> list = ChunkListFromWire(message.digest(), message.chunks());
  if (!list.ok()) return finish(list.status());
  absl::StatusOr<ChunkedWrite> write =
      ChunkedWrite::Begin(*blobs_, &content_->chunks(), *list, message.offset_bytes());
  // Another client brought it: a blob never changes.
  if (absl::IsAlreadyExists(write.status())) return finish(absl::OkStatus());
  if (!write.ok()) return finish(OfSharedUpload(write.status()));
  const uint64_t asked_bytes = list->blob.size_bytes - message.offset_bytes();
  absl::StatusOr<UploadClaim> claim =
      BeginUpload(*context, farm_, access_, "WriteChunks", list->blob.sha256_hex, asked_bytes);
  if (!claim.ok()) {
    write->Discard();
    return finish(claim.status());
  }
  uint64_t received_bytes = 0;
  absl::Status status = WriteAll(reader, &message, &*write, &*claim, &received_bytes);
  if (status.ok() && context->IsCancelled()) {
    status = write->Flush();
    if (status.ok())
      status = absl::CancelledError(
          "the upload was interrupted; it can be "
          "continued");
  } else if (status.ok()) {
    status = write->Finish();
  }
  ReturnUpload(*context, access_, asked_bytes - received_bytes);
  NoteUpload(*context, farm_, list->blob, received_bytes);
  content_->NoteReused(write->reused_bytes());
  response->set_reused_bytes(write->reused_bytes());
  return finish(status);
}

grpc::Status TransferService::LocateBlob(grpc::ServerContext* /*context*/,
                                         const v1::LocateBlobRequest* request,
                                         v1::LocateBlobResponse* response) {
  const absl::StatusOr<BlobDigest> blob = FromWire(request->digest());
  if (!blob.ok()) return ToGrpcStatus(blob.status());
  absl::Status checked = CheckWorkerId(request->worker_id());
  checked.Update(CheckCount("tried", request->tried_size(), kTriedPeersMax));
  if (!checked.ok()) return ToGrpcStatus(checked);
  const std::set<std::string> tried(request->tried().begin(), request->tried().end());
  PeerAnswer answer = content_->Locate(blob->sha256_hex, request->worker_id(), request->serves(),
                                       tried, SteadyTime::Now());
  if (!answer.peers.empty() && blob->size_bytes > kUnchunkedBytesMax) {
    const absl::StatusOr<ChunkList> list = content_->chunks().ListOf(*blob);
    if (list.ok()) {
      ChunksToWire(*list, response->mutable_chunks());
    } else {
      answer = {{}, true};  // Bytes of peers could not be verified as they come.
    }
  }
  for (const PeerContact& contact : answer.peers) {
    v1::Peer* peer = response->add_peers();
    peer->set_worker_id(contact.worker_id);
    peer->set_address(contact.address);
    peer->set_identity(contact.identity);
  }
  response->set_from_coordinator(answer.from_coordinator);
  if (answer.peers.empty() && !answer.from_coordinator) {
    response->mutable_retry_after()->set_nanos(
        static_cast<int32_t>(absl::ToInt64Nanoseconds(kLocateRetry)));
  }
  return grpc::Status::OK;
}

grpc::Status TransferService::ReportContent(grpc::ServerContext* context,
                                            const v1::ReportContentRequest* request,
                                            v1::ReportContentResponse* response) {
  absl::StatusOr<ContentReport> report = FromWire(*request);
  if (!report.ok()) return ToGrpcStatus(report.status());
  report->worker = {request->worker_id(), PeerAddress(*context, request->peer_port()),
                    CallerIdentity(*context)};
  content_->Report(*report, SteadyTime::Now());
  response->set_directory_id(content_->directory_id());
  return grpc::Status::OK;
}

}  // namespace sheaf::coordinator
