// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/upkeep/upload_claims.h"

#include <algorithm>

namespace sheaf::coordinator {

UploadClaim::~UploadClaim() {
  if (claims_ == nullptr) return;
  const MutexLock lock(&claims_->mutex_);
  claims_->entries_.erase(number_);
}

void UploadClaim::NoteWritten(uint64_t bytes) {
  const MutexLock lock(&claims_->mutex_);
  uint64_t& left = claims_->entries_.at(number_).bytes;
  left -= std::min(left, bytes);
}

std::optional<UploadClaim> UploadClaims::Claim(const std::string& blob, uint64_t bytes,
                                               const std::function<uint64_t()>& room) {
  const MutexLock lock(&mutex_);
  const uint64_t claimed = Sum(), most = room();
  if (claimed > most || bytes > most - claimed) return std::nullopt;
  entries_[next_] = {blob, bytes};
  return UploadClaim(this, next_++);
}

uint64_t UploadClaims::Bytes() const {
  const MutexLock lock(&mutex_);
  return Sum();
}

std::set<std::string> UploadClaims::Blobs() const {
  const MutexLock lock(&mutex_);
  std::set<std::string> blobs;
  for (const auto& [number, entry] : entries_) blobs.insert(entry.blob);
  return blobs;
}

uint64_t UploadClaims::Sum() const {
  uint64_t sum = 0;
  for (const auto& [number, entry] : entries_) sum += entry.bytes;
  return sum;
}

}  // namespace sheaf::coordinator
