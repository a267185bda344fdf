// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// UploadClaims: disk space promised to uploads and not yet written.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "common/base/mutex.h"

namespace sheaf::coordinator {

class UploadClaims;

// The claim of one upload. Its end releases the bytes that were not written. Thread safety: one
// thread at a time.
class UploadClaim {
 public:
  ~UploadClaim();
  UploadClaim(UploadClaim&& other) noexcept
      : claims_(std::exchange(other.claims_, nullptr)), number_(other.number_) {}
  UploadClaim& operator=(UploadClaim&&) = delete;
  // This many of its bytes are written, so that the file system counts them.
  void NoteWritten(uint64_t bytes);

 private:
  friend class UploadClaims;
  UploadClaim(UploadClaims* claims, uint64_t number) : claims_(claims), number_(number) {}
  UploadClaims* claims_;
  uint64_t number_;
};

// Thread safety: all members may be called concurrently. Outlives its claims.
class UploadClaims {
 public:
  // Claims the bytes if the sum of all claims is at most room(). blob: its SHA-256, or empty for
  // several blobs.
  std::optional<UploadClaim> Claim(const std::string& blob, uint64_t bytes,
                                   const std::function<uint64_t()>& room);
  uint64_t Bytes() const;
  // The blobs that are being uploaded.
  std::set<std::string> Blobs() const;

 private:
  friend class UploadClaim;
  struct Entry {
    std::string blob;
    uint64_t bytes = 0;
  };
  uint64_t Sum() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  mutable Mutex mutex_;
  std::map<uint64_t, Entry> entries_ ABSL_GUARDED_BY(mutex_);
  uint64_t next_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace sheaf::coordinator
