// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/chunked_write.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/status.h"
#include "common/content/file_descriptor.h"

namespace sheaf {
namespace {

// The last chunk of a killed write may be incomplete: shortens the partial file to whole chunks.
absl::Status ShortenUpload(const BlobStore& store, const BlobDigest& blob, uint64_t size_bytes) {
  const std::string path = store.PartialPath(blob);
  const FileDescriptor file(::open(path.c_str(), O_RDWR | O_CLOEXEC));
  if (!file.ok()) return absl::OkStatus();  // Nothing is there, or BeginWrite says why not.
  if (::flock(file.get(), LOCK_EX | LOCK_NB) != 0) {
    return absl::UnavailableError(absl::StrCat(path, ": another upload is writing this blob"));
  }
  if (::ftruncate(file.get(), static_cast<off_t>(size_bytes)) == 0) return absl::OkStatus();
  return StatusFromErrno(errno, absl::StrCat("shortening ", path));
}

// The number of chunks that lie before the offset, and the bytes that they have.
std::pair<size_t, uint64_t> ChunksBefore(const ChunkList& list, uint64_t offset_bytes) {
  size_t count = 0;
  uint64_t bytes = 0;
  while (count < list.chunks.size() && bytes + list.chunks[count].size_bytes <= offset_bytes) {
    bytes += list.chunks[count++].size_bytes;
  }
  return {count, bytes};
}

}  // namespace

absl::StatusOr<ChunkPlan> PlanChunks(const BlobStore& store, ChunkIndex* index,
                                     const ChunkList& list) {
  if (absl::Status status = CheckChunkList(list); !status.ok()) return status;
  const absl::StatusOr<BlobWriteStatus> there = store.GetWriteStatus(list.blob);
  if (!there.ok()) return there.status();
  if (there->complete) return ChunkPlan{true, 0, {}};
  const auto [first, offset_bytes] = ChunksBefore(list, there->committed_bytes);
  ChunkPlan plan{false, offset_bytes, {}};
  for (size_t i = first; i < list.chunks.size(); ++i) {
    if (!index->Has(list.chunks[i])) plan.missing.push_back(i);
  }
  return plan;
}

absl::StatusOr<ChunkedWrite> ChunkedWrite::Begin(const BlobStore& store, ChunkIndex* index,
                                                 const ChunkList& list, uint64_t offset_bytes) {
  if (absl::Status status = CheckChunkList(list); !status.ok()) return status;
  const auto [first, begin_bytes] = ChunksBefore(list, offset_bytes);
  const absl::StatusOr<BlobWriteStatus> there = store.GetWriteStatus(list.blob);
  if (!there.ok()) return there.status();
  if (begin_bytes != offset_bytes || (!there->complete && offset_bytes > there->committed_bytes)) {
    return absl::OutOfRangeError(
        absl::StrCat("blob ", list.blob.sha256_hex, ": ", there->committed_bytes,
                     " bytes are there, the write began at ", offset_bytes));
  }
  if (!there->complete && offset_bytes < there->committed_bytes) {
    const absl::Status status = ShortenUpload(store, list.blob, offset_bytes);
    if (!status.ok()) return status;
  }
  absl::StatusOr<BlobWriter> writer = store.BeginWrite(list.blob, offset_bytes);
  if (!writer.ok()) return writer.status();
  return ChunkedWrite(index, list, *std::move(writer), first);
}

absl::Status ChunkedWrite::FillTo(size_t index) {
  for (; next_ < index; ++next_) {
    const absl::StatusOr<std::string> bytes = index_->Read(list_.chunks[next_]);
    if (!bytes.ok()) return absl::FailedPreconditionError(bytes.status().message());
    if (absl::Status status = writer_.Append(*bytes); !status.ok()) return status;
    reused_bytes_ += bytes->size();
  }
  return absl::OkStatus();
}

absl::Status ChunkedWrite::Append(size_t index, std::string_view bytes) {
  if (index < next_ || index >= list_.chunks.size()) {
    return absl::InvalidArgumentError(absl::StrCat("blob ", list_.blob.sha256_hex, ": chunk ",
                                                   index, " does not follow chunk ", next_));
  }
  const BlobDigest& chunk = list_.chunks[index];
  if (bytes.size() != chunk.size_bytes || Sha256Hex(bytes) != chunk.sha256_hex) {
    return absl::InvalidArgumentError(
        absl::StrCat("blob ", list_.blob.sha256_hex, ": chunk ", index,
                     " has other bytes than its digest; the file changed or was damaged"));
  }
  if (absl::Status status = FillTo(index); !status.ok()) return status;
  if (absl::Status status = writer_.Append(bytes); !status.ok()) return status;
  ++next_;
  return absl::OkStatus();
}

absl::Status ChunkedWrite::Finish() {
  if (absl::Status status = FillTo(list_.chunks.size()); !status.ok()) return status;
  if (absl::Status status = writer_.Commit(); !status.ok()) return status;
  if (first_ == 0) return index_->Add(list_);
  // The chunks of an earlier attempt were not compared with this list: start over.
  return index_->ListOf(list_.blob).status();
}

}  // namespace sheaf
