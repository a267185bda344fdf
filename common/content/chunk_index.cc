// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/chunk_index.h"

#include <unistd.h>

#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/content/chunk_cutter.h"

namespace sheaf {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kListBytesMax = uint64_t{64} << 20;

}  // namespace

std::string ChunkIndex::PathOf(const BlobDigest& blob) const {
  return absl::StrCat(store_.directory(), "/chunks/", blob.sha256_hex);
}

void ChunkIndex::LoadOnce() {
  if (std::exchange(loaded_, true)) return;
  const std::string folder = absl::StrCat(store_.directory(), "/chunks");
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string path = it->path().string();
    const absl::StatusOr<std::string> text = ReadWholeFile(path, kListBytesMax);
    const absl::StatusOr<ChunkList> list =
        text.ok() ? DecodeChunkList(*text) : absl::StatusOr<ChunkList>(text.status());
    // A list is removed with its blob. An unreadable one is rebuilt when it is needed.
    const bool kept = list.ok() && list->blob.sha256_hex == it->path().filename().string() &&
                      ::access(store_.FinalPath(list->blob).c_str(), F_OK) == 0;
    if (kept) {
      Index(*list);
    } else {
      ::unlink(path.c_str());
    }
  }
}

void ChunkIndex::Index(const ChunkList& list) {
  const size_t blob = blobs_.size();
  blobs_.push_back(list.blob);
  uint64_t offset_bytes = 0;
  for (const BlobDigest& chunk : list.chunks) {
    if (places_.size() >= kIndexedChunksMax) return;
    places_[chunk.sha256_hex] = {blob, offset_bytes};  // The newest blob stays the longest.
    offset_bytes += chunk.size_bytes;
  }
}

absl::Status ChunkIndex::Add(const ChunkList& list) {
  if (absl::Status status = CheckChunkList(list); !status.ok()) return status;
  const MutexLock lock(&mutex_);
  LoadOnce();
  const std::string folder = absl::StrCat(store_.directory(), "/chunks");
  if (absl::Status status = MakeDirectories(folder); !status.ok()) return status;
  const absl::Status written = WriteSecretAtomically(PathOf(list.blob), EncodeChunkList(list));
  if (written.ok()) Index(list);
  return written;
}

absl::StatusOr<ChunkList> ChunkIndex::ListOf(const BlobDigest& blob) {
  const absl::StatusOr<std::string> path = store_.PathOf(blob);
  if (!path.ok()) return path.status();
  if (const absl::StatusOr<std::string> text = ReadWholeFile(PathOf(blob), kListBytesMax);
      text.ok()) {
    absl::StatusOr<ChunkList> list = DecodeChunkList(*text);
    if (list.ok() && list->blob == blob) return list;
  }
  absl::StatusOr<ChunkList> cut = CutFile(*path);
  if (!cut.ok()) return cut.status();
  if (cut->blob != blob) {
    return absl::UnavailableError(absl::StrCat(*path, ": changed while it was cut; try again"));
  }
  if (absl::Status status = Add(*cut); !status.ok()) return status;
  return cut;
}

absl::StatusOr<std::pair<BlobDigest, uint64_t>> ChunkIndex::Find(const BlobDigest& chunk) {
  const MutexLock lock(&mutex_);
  LoadOnce();
  const auto found = places_.find(chunk.sha256_hex);
  if (found == places_.end()) {
    return absl::NotFoundError(absl::StrCat("no blob has the chunk ", chunk.sha256_hex));
  }
  return std::pair(blobs_[found->second.blob], found->second.offset_bytes);
}

bool ChunkIndex::Has(const BlobDigest& chunk) {
  const absl::StatusOr<std::pair<BlobDigest, uint64_t>> place = Find(chunk);
  if (!place.ok()) return false;
  const absl::StatusOr<std::vector<BlobDigest>> missing = store_.FindMissing({place->first});
  if (missing.ok() && missing->empty()) return true;
  ::unlink(PathOf(place->first).c_str());
  const MutexLock lock(&mutex_);
  places_.erase(chunk.sha256_hex);
  return false;
}

absl::StatusOr<std::string> ChunkIndex::Read(const BlobDigest& chunk) {
  const absl::StatusOr<std::pair<BlobDigest, uint64_t>> place = Find(chunk);
  if (!place.ok()) return place.status();
  absl::StatusOr<std::string> bytes =
      store_.ReadChunk(place->first, place->second, chunk.size_bytes);
  if (bytes.ok() && Sha256Hex(*bytes) == chunk.sha256_hex) return bytes;
  const MutexLock lock(&mutex_);
  places_.erase(chunk.sha256_hex);
  return absl::NotFoundError(
      absl::StrCat("chunk ", chunk.sha256_hex, " is no longer in blob ", place->first.sha256_hex));
}

}  // namespace sheaf
