// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The calls of FarmClient that upload one blob, from where an earlier attempt ended.
#include <grpcpp/client_context.h>

#include <algorithm>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "cli/job/farm_client.h"
#include "cli/job/wire_digest.h"
#include "common/base/digest.h"
#include "common/content/blob_store.h"
#include "common/content/chunk_codec.h"
#include "common/content/shared_upload.h"
#include "common/rpc/channel.h"
#include "common/rpc/grpc_status.h"

namespace sheaf::cli {
namespace {

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

}  // namespace sheaf::cli
