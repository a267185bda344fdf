// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/chunk_list.h"

#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/base/status.h"

namespace sheaf {

absl::Status CheckChunkList(const ChunkList& list) {
  if (absl::Status status = CheckDigest(list.blob); !status.ok()) return status;
  const std::string what = absl::StrCat("chunks of blob ", list.blob.sha256_hex, ": ");
  if (list.chunks.size() > kChunksPerBlobMax) {
    return absl::InvalidArgumentError(
        absl::StrCat(what, list.chunks.size(), " are more than the limit of ", kChunksPerBlobMax));
  }
  uint64_t sum = 0;
  for (size_t i = 0; i < list.chunks.size(); ++i) {
    const BlobDigest& chunk = list.chunks[i];
    if (absl::Status status = CheckDigest(chunk); !status.ok()) return Annotate(status, what);
    const bool last = i + 1 == list.chunks.size();
    const uint64_t least = last ? 1 : kChunkBytesMin;
    if (chunk.size_bytes < least || chunk.size_bytes > kChunkBytesMax) {
      return absl::InvalidArgumentError(absl::StrCat(what, "number ", i, " has ", chunk.size_bytes,
                                                     " bytes, not ", least, " to ",
                                                     kChunkBytesMax));
    }
    sum += chunk.size_bytes;
  }
  if (sum == list.blob.size_bytes) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(what, "they have ", sum, " bytes, the blob has ", list.blob.size_bytes));
}

std::string EncodeChunkList(const ChunkList& list) {
  std::string text = absl::StrCat(list.blob.sha256_hex, " ", list.blob.size_bytes, "\n");
  for (const BlobDigest& chunk : list.chunks) {
    absl::StrAppend(&text, chunk.sha256_hex, " ", chunk.size_bytes, "\n");
  }
  return text;
}

absl::StatusOr<ChunkList> DecodeChunkList(std::string_view text) {
  std::vector<BlobDigest> digests;
  const absl::string_view lines(text.data(), text.size());
  for (const absl::string_view line : absl::StrSplit(lines, '\n', absl::SkipEmpty())) {
    const std::pair<absl::string_view, absl::string_view> parts =
        absl::StrSplit(line, absl::MaxSplits(' ', 1));
    BlobDigest digest{std::string(parts.first), 0};
    if (!absl::SimpleAtoi(parts.second, &digest.size_bytes)) {
      return absl::InvalidArgumentError("a list of chunks has a line without a size");
    }
    digests.push_back(std::move(digest));
    if (digests.size() > kChunksPerBlobMax + 1) break;
  }
  if (digests.empty()) return absl::InvalidArgumentError("a list of chunks is empty");
  ChunkList list;
  list.blob = std::move(digests.front());
  digests.erase(digests.begin());
  list.chunks = std::move(digests);
  if (absl::Status status = CheckChunkList(list); !status.ok()) return status;
  return list;
}

}  // namespace sheaf
