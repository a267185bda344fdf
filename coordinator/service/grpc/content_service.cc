// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/content_service.h"

#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/content/chunk_codec.h"
#include "common/rpc/grpc_status.h"
#include "coordinator/service/grpc/caller.h"
#include "coordinator/service/grpc/drain_stream.h"
#include "coordinator/service/grpc/upload_use.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

absl::Status AppendChunk(const v1::WriteBlobRequest& message, BlobWriter* writer) {
  const absl::StatusOr<std::string> bytes =
      DecompressChunk(message.zstd_chunk(), kBlobChunkBytesMax);
  if (!bytes.ok()) return bytes.status();
  return writer->Append(*bytes);
}

// Writes the messages of one upload. The bytes before an error or a broken stream stay durable, and
// the upload can be resumed.
absl::Status WriteAll(v1::WriteBlobRequest* message,
                      grpc::ServerReader<v1::WriteBlobRequest>* reader, BlobWriter* writer,
                      const BlobDigest& digest, UploadClaim* claim) {
  do {
    const uint64_t before = writer->committed_bytes();
    absl::Status status = AppendChunk(*message, writer);
    claim->NoteWritten(writer->committed_bytes() - before);
    if (!status.ok()) {
      writer->Flush().IgnoreError();
      return status;
    }
  } while (reader->Read(message));
  if (writer->committed_bytes() == digest.size_bytes) return writer->Commit();
  if (absl::Status status = writer->Flush(); !status.ok()) return status;
  return absl::InvalidArgumentError(
      absl::StrCat("blob ", digest.sha256_hex, ": ", writer->committed_bytes(), " of ",
                   digest.size_bytes, " bytes were received; resume there"));
}

// Answers an upload after reading the rest of its sender's stream.
grpc::Status Finish(const absl::Status& status, v1::WriteBlobRequest* message,
                    grpc::ServerReader<v1::WriteBlobRequest>* reader) {
  DrainStream(message, reader);
  return ToGrpcStatus(status);
}

}  // namespace

grpc::Status ContentService::FindMissing(grpc::ServerContext* /*context*/,
                                         const v1::FindMissingRequest* request,
                                         v1::FindMissingResponse* response) {
  if (request->digests_size() > kFindMissingDigestsMax) {
    return ToGrpcStatus(absl::InvalidArgumentError(
        absl::StrCat(request->digests_size(), " digests are more than ", kFindMissingDigestsMax)));
  }
  std::vector<BlobDigest> digests;
  for (const v1::Digest& wire : request->digests()) {
    absl::StatusOr<BlobDigest> digest = FromWire(wire);
    if (!digest.ok()) return ToGrpcStatus(digest.status());
    digests.push_back(*std::move(digest));
  }
  const absl::StatusOr<std::vector<BlobDigest>> missing = blobs_->FindMissing(digests);
  if (!missing.ok()) return ToGrpcStatus(missing.status());
  uint64_t bytes = 0;
  for (const BlobDigest& digest : *missing) {
    *response->add_missing() = ToWire(digest);
    bytes += std::min(digest.size_bytes, UINT64_MAX - bytes);
  }
  // Before the first byte of the first one: a part of a scene is useless.
  return ToGrpcStatus(bytes == 0 ? absl::OkStatus()
                                 : farm_->keeper().ClaimUpload("", bytes).status());
}

grpc::Status ContentService::GetWriteStatus(grpc::ServerContext* /*context*/,
                                            const v1::GetWriteStatusRequest* request,
                                            v1::GetWriteStatusResponse* response) {
  const absl::StatusOr<BlobDigest> digest = FromWire(request->digest());
  if (!digest.ok()) return ToGrpcStatus(digest.status());
  const absl::StatusOr<BlobWriteStatus> status = blobs_->GetWriteStatus(*digest);
  if (!status.ok()) return ToGrpcStatus(status.status());
  response->set_committed_bytes(status->committed_bytes);
  response->set_complete(status->complete);
  return grpc::Status::OK;
}

grpc::Status ContentService::WriteBlob(grpc::ServerContext* context,
                                       grpc::ServerReader<v1::WriteBlobRequest>* reader,
                                       v1::WriteBlobResponse* response) {
  const absl::StatusOr<IdentityUse::Stream> stream = OpenStream(*context, access_, "WriteBlob");
  if (!stream.ok()) return ToGrpcStatus(stream.status());
  v1::WriteBlobRequest message;
  if (!reader->Read(&message) || !message.has_digest()) {
    return ToGrpcStatus(absl::InvalidArgumentError("the first message has no digest"));
  }
  const absl::StatusOr<BlobDigest> digest = FromWire(message.digest());
  if (!digest.ok()) return Finish(digest.status(), &message, reader);
  absl::StatusOr<BlobWriter> writer = blobs_->BeginWrite(*digest, message.offset_bytes());
  if (absl::IsAlreadyExists(writer.status())) {
    response->set_committed_bytes(digest->size_bytes);
    // Another client brought it: a blob never changes.
    return Finish(absl::OkStatus(), &message, reader);
  }
  if (!writer.ok()) return Finish(OfSharedUpload(writer.status()), &message, reader);
  const uint64_t asked_bytes = digest->size_bytes - writer->committed_bytes();
  absl::StatusOr<UploadClaim> claim =
      BeginUpload(*context, farm_, access_, "WriteBlob", digest->sha256_hex, asked_bytes);
  if (!claim.ok()) {
    writer->Discard();
    return Finish(claim.status(), &message, reader);
  }
  const absl::Status status = WriteAll(&message, reader, &*writer, *digest, &*claim);
  const uint64_t missing_bytes = digest->size_bytes - writer->committed_bytes();
  ReturnUpload(*context, access_, missing_bytes);
  NoteUpload(*context, farm_, *digest, asked_bytes - missing_bytes);
  response->set_committed_bytes(writer->committed_bytes());
  return Finish(status, &message, reader);
}

grpc::Status ContentService::ReadBlob(grpc::ServerContext* context,
                                      const v1::ReadBlobRequest* request,
                                      grpc::ServerWriter<v1::ReadBlobResponse>* writer) {
  const absl::StatusOr<IdentityUse::Stream> stream = OpenStream(*context, access_, "ReadBlob");
  if (!stream.ok()) return ToGrpcStatus(stream.status());
  const absl::StatusOr<BlobDigest> digest = FromWire(request->digest());
  if (!digest.ok()) return ToGrpcStatus(digest.status());
  uint64_t offset_bytes = request->offset_bytes();
  const bool whole = offset_bytes == 0;
  Sha256 hash;  // Hashes the bytes read now: bit rot does not change time stamps.
  while (!context->IsCancelled()) {
    const absl::StatusOr<std::string> chunk =
        blobs_->ReadChunk(*digest, offset_bytes, kBlobChunkBytesMax);
    if (absl::IsNotFound(chunk.status())) blobs_->NoteLost(*digest);
    if (!chunk.ok()) return ToGrpcStatus(chunk.status());
    if (chunk->empty()) {
      if (!whole || hash.FinishHex() == digest->sha256_hex) break;
      const absl::Status verified = blobs_->Verify(*digest);
      return ToGrpcStatus(!verified.ok()
                              ? verified
                              : absl::UnavailableError(absl::StrCat(
                                    "blob ", digest->sha256_hex,
                                    ": the bytes read do not match its digest; read it again")));
    }
    if (whole) hash.Update(*chunk);
    v1::ReadBlobResponse response;
    response.set_zstd_chunk(CompressChunk(*chunk));
    if (!writer->Write(response)) break;
    farm_->content().NoteSent(chunk->size());
    offset_bytes += chunk->size();
  }
  return grpc::Status::OK;
}

}  // namespace sheaf::coordinator
