// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The calls of FarmClient that upload: one blob, from where an earlier attempt ended; many small
// ones at once; large ones by chunks.
#include <fcntl.h>
#include <grpcpp/client_context.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "cli/job/blob_reader.h"
#include "cli/job/farm_client.h"
#include "cli/job/wire_digest.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/base/retry_after.h"
#include "common/base/status.h"
#include "common/content/blob_batch.h"
#include "common/content/blob_store.h"
#include "common/content/chunk_codec.h"
#include "common/content/chunk_cutter.h"
#include "common/content/file_descriptor.h"
#include "common/content/shared_upload.h"
#include "common/rpc/channel.h"
#include "common/rpc/chunk_list_codec.h"
#include "common/rpc/grpc_status.h"

namespace sheaf::cli {
namespace {

// The bytes of a blob, as its digest says.
absl::StatusOr<std::string> BytesOf(const BlobSource& blob) {
  if (blob.path.empty()) return blob.bytes;
  absl::StatusOr<std::string> bytes = ReadWholeFile(blob.path, blob.digest.size_bytes);
  if (absl::IsResourceExhausted(bytes.status())) return ChangedError(blob.path);
  if (bytes.ok() && Sha256Hex(*bytes) != blob.digest.sha256_hex) return ChangedError(blob.path);
  return bytes;
}

// A chunk of a file, as its digest says.
absl::StatusOr<std::string> ReadFileChunk(int fd, const std::string& path, uint64_t offset_bytes,
                                          const BlobDigest& chunk) {
  std::string bytes(chunk.size_bytes, '\0');
  size_t filled = 0;
  while (filled < bytes.size()) {
    const ssize_t n = ::pread(fd, bytes.data() + filled, bytes.size() - filled,
                              static_cast<off_t>(offset_bytes + filled));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return StatusFromErrno(errno, path);
    if (n == 0) return ChangedError(path);
    filled += static_cast<size_t>(n);
  }
  if (Sha256Hex(bytes) != chunk.sha256_hex) return ChangedError(path);
  return bytes;
}

// Sends the planned chunks of a file. Errors of the file itself are in *own.
absl::Status SendChunks(grpc::ClientContext* context, v1::TransferService::Stub* stub,
                        const std::string& path, const ChunkList& list,
                        const v1::PlanWriteResponse& plan,
                        const std::function<void(uint64_t)>& on_progress, absl::Status* own) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.ok()) return *own = StatusFromErrno(errno, path);
  v1::WriteChunksResponse response;
  const auto writer = stub->WriteChunks(context, &response);
  v1::WriteChunksRequest request;
  SetWireDigest(list.blob, request.mutable_digest());
  ChunksToWire(list, request.mutable_chunks());
  request.set_offset_bytes(plan.offset_bytes());
  bool open = writer->Write(request);
  uint64_t offset_bytes = 0;
  size_t index = 0;
  for (const uint32_t missing : plan.missing()) {
    if (!open || missing >= list.chunks.size() || missing < index) break;
    for (; index < missing; ++index) offset_bytes += list.chunks[index].size_bytes;
    const absl::StatusOr<std::string> bytes =
        ReadFileChunk(file.get(), path, offset_bytes, list.chunks[index]);
    if (!bytes.ok()) {
      context->TryCancel();
      writer->Finish();
      return *own = bytes.status();
    }
    v1::WriteChunksRequest chunk;
    chunk.set_index(missing);
    chunk.set_zstd_chunk(CompressChunk(*bytes));
    open = writer->Write(chunk);  // If it is closed, Finish says why.
    if (open) on_progress(bytes->size());
  }
  writer->WritesDone();
  return FromGrpcStatus(writer->Finish());
}

}  // namespace

absl::StatusOr<uint64_t> FarmClient::CommittedBytes(const BlobDigest& digest, bool* complete) {
  v1::GetWriteStatusRequest request;
  SetWireDigest(digest, request.mutable_digest());
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
      SetWireDigest(blob.digest, request.mutable_digest());
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
        return absl::IsOutOfRange(sent) ? SharedUploadError() : sent;
      },
      kStreamDeadline);
  if (!absl::IsInvalidArgument(status) || blob.path.empty()) return status;
  const absl::StatusOr<FileDigest> now = Sha256OfFile(blob.path);
  if (!now.ok() || now->sha256_hex != blob.digest.sha256_hex) {
    return absl::FailedPreconditionError(
        absl::StrCat(blob.path, ": changed while it was being uploaded; submit again"));
  }
  return status;
}

absl::Status FarmClient::UploadSmall(const std::vector<const BlobSource*>& blobs,
                                     const std::function<void(uint64_t)>& on_progress) {
  v1::WriteSmallBlobsRequest request;
  std::string bytes;
  for (const BlobSource* blob : blobs) {
    const absl::StatusOr<std::string> own = BytesOf(*blob);
    if (!own.ok()) return own.status();
    SetWireDigest(blob->digest, request.add_digests());
    bytes += *own;
  }
  request.set_zstd_bytes(CompressChunk(bytes));
  v1::WriteSmallBlobsResponse response;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(transfer_->WriteSmallBlobs(context, request, &response));
      },
      kUnaryDeadline);
  if (status.ok()) on_progress(bytes.size());
  if (!absl::IsUnimplemented(status)) return status;
  for (const BlobSource* blob : blobs) {  // An earlier coordinator.
    if (absl::Status one = Upload(*blob, on_progress); !one.ok()) return one;
  }
  return absl::OkStatus();
}

absl::StatusOr<v1::PlanWriteResponse> FarmClient::PlanWrite(const ChunkList& list) {
  v1::PlanWriteRequest request;
  SetWireDigest(list.blob, request.mutable_digest());
  ChunksToWire(list, request.mutable_chunks());
  v1::PlanWriteResponse plan;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) {
        return FromGrpcStatus(transfer_->PlanWrite(context, request, &plan));
      },
      kUnaryDeadline);
  if (!status.ok()) return status;
  return plan;
}

absl::Status FarmClient::UploadByChunks(const BlobSource& blob,
                                        const std::function<void(uint64_t)>& on_progress) {
  if (blob.path.empty()) return Upload(blob, on_progress);
  const absl::StatusOr<ChunkList> list = CutFile(blob.path);
  if (!list.ok()) return list.status();
  if (list->blob != blob.digest) return ChangedError(blob.path);
  if (list->chunks.size() > kChunksPerBlobMax) return Upload(blob, on_progress);
  bool is_first = true;
  absl::Status own;
  const absl::Status status = Call(
      [&](grpc::ClientContext* context) -> absl::Status {
        const absl::StatusOr<v1::PlanWriteResponse> plan = PlanWrite(*list);
        if (!plan.ok()) return plan.status();
        if (plan->complete()) return absl::OkStatus();
        uint64_t to_send_bytes = 0;
        for (const uint32_t missing : plan->missing()) {
          if (missing < list->chunks.size()) to_send_bytes += list->chunks[missing].size_bytes;
        }
        if (std::exchange(is_first, false)) on_progress(blob.digest.size_bytes - to_send_bytes);
        const absl::Status sent =
            SendChunks(context, transfer_.get(), blob.path, *list, *plan, on_progress, &own);
        if (!own.ok()) return own;
        // Planned again.
        if (absl::IsOutOfRange(sent)) return SharedUploadError();
        if (absl::IsFailedPrecondition(sent)) {
          return RetryAfterError("a chunk has disappeared", kSharedUploadWait);
        }
        return sent;
      },
      kStreamDeadline);
  return absl::IsUnimplemented(status) ? Upload(blob, on_progress) : status;
}

}  // namespace sheaf::cli
