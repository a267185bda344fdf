// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// BlobReader: the bytes of a blob of this machine, in order.
#pragma once

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "cli/job/farm_client.h"
#include "common/content/blob_store.h"

namespace sheaf::cli {

inline absl::Status ChangedError(const std::string& path) {
  return absl::FailedPreconditionError(
      absl::StrCat(path, ": changed while it was being uploaded; submit again"));
}

// Thread safety: none.
class BlobReader {
 public:
  // blob must outlive the object. Reads from offset_bytes on.
  BlobReader(const BlobSource& blob, uint64_t offset_bytes) : blob_(blob), offset_(offset_bytes) {
    if (blob.path.empty()) return;
    file_.open(blob.path, std::ios::binary);
    file_.seekg(static_cast<std::streamoff>(offset_bytes));
  }
  // At most kBlobChunkBytesMax bytes. Errors: kFailedPrecondition if the file was truncated or
  // became unreadable.
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

}  // namespace sheaf::cli
