// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/access/identity_limits.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/base/retry_after.h"
#include "common/base/surroundings/local_time.h"
#include "coordinator/access/peer_network.h"

namespace sheaf::coordinator {
namespace {

constexpr absl::Duration kUploadPeriod = absl::Hours(24);
// After a refused call, a caller waits until the calls of one second are available.
constexpr absl::Duration kRateWait = absl::Seconds(1);

}  // namespace

const char* IdentityLimitName(IdentityLimit limit) {
  switch (limit) {
    case IdentityLimit::kCalls:
      return "calls";
    case IdentityLimit::kStrangerCalls:
      return "stranger_calls";
    case IdentityLimit::kStreams:
      return "streams";
    case IdentityLimit::kUploadBytes:
      return "upload_bytes";
    case IdentityLimit::kConnections:
      return "connections";
    case IdentityLimit::kStoredBytes:
      return "stored_bytes";
  }
  return "unknown";
}

bool IdentityUse::Bucket::Take(double rate, double burst, absl::Time now) {
  const double gained = rate * absl::ToDoubleSeconds(now - time);
  left = std::min(burst, left + std::max(0.0, gained));
  time = std::max(time, now);
  if (left < 1) return false;
  left -= 1;
  return true;
}

absl::Status IdentityUse::Refuse(IdentityLimit limit, const std::string& message) {
  ++refused_[static_cast<size_t>(limit)];
  const bool passes = limit == IdentityLimit::kCalls || limit == IdentityLimit::kStrangerCalls;
  return passes ? RetryAfterError(message, kRateWait) : absl::ResourceExhaustedError(message);
}

absl::Status IdentityUse::NoteCall(const IdentityId& id, absl::Time now) {
  const MutexLock lock(&mutex_);
  if (uses_[id].calls.Take(limits_.calls_per_second_max, limits_.calls_burst_max, now)) {
    return absl::OkStatus();
  }
  return Refuse(
      IdentityLimit::kCalls,
      absl::StrCat(FormatIdentity(id), " makes more calls than ", limits_.calls_per_second_max,
                   " a second, the limit of an identity; call less often, or start the "
                   "coordinator with a higher --calls-per-second-max"));
}

IdentityUse::Bucket& IdentityUse::BucketOf(const std::string& network) {
  const auto found = strangers_.find(network);
  if (found != strangers_.end()) return found->second;
  if (strangers_.size() >= kStrangerAddressesMax) strangers_.clear();
  return strangers_[network];
}

absl::Status IdentityUse::NoteStrangerCall(const std::string& address, absl::Time now) {
  const std::string network = PeerNetwork(address);
  const MutexLock lock(&mutex_);
  if (BucketOf(network).Take(limits_.stranger_calls_per_second_max,
                             limits_.stranger_calls_burst_max, now)) {
    return absl::OkStatus();
  }
  return Refuse(
      IdentityLimit::kStrangerCalls,
      absl::StrCat("callers at ", network, " that show no identity make more calls than ",
                   limits_.stranger_calls_per_second_max, " a second, the limit of an address"));
}

absl::StatusOr<IdentityUse::Stream> IdentityUse::OpenStream(const IdentityId& id) {
  const int64_t streams_max =
      id.kind == IdentityKind::kWorker ? limits_.worker_streams_max : limits_.user_streams_max;
  const MutexLock lock(&mutex_);
  Use& use = uses_[id];
  if (use.streams >= streams_max) {
    return Refuse(IdentityLimit::kStreams,
                  absl::StrCat(FormatIdentity(id), " has ", use.streams,
                               " uploads, downloads and watches open, the limit of an identity; "
                               "wait until some have ended, or end some"));
  }
  ++use.streams;
  return Stream(this, id);
}

void IdentityUse::CloseStream(const IdentityId& id) {
  const MutexLock lock(&mutex_);
  --uses_[id].streams;
}

absl::Status IdentityUse::BeginUpload(const IdentityId& id, uint64_t size_bytes, absl::Time now) {
  const MutexLock lock(&mutex_);
  Use& use = uses_[id];
  if (now - use.day_begin >= kUploadPeriod) {
    use.day_begin = now;
    use.upload_bytes = 0;
  }
  if (size_bytes > limits_.upload_bytes_per_day_max - use.upload_bytes) {
    const std::string end =
        absl::FormatTime("%Y-%m-%d %H:%M", use.day_begin + kUploadPeriod, LocalZone());
    return Refuse(
        IdentityLimit::kUploadBytes,
        absl::StrCat(FormatIdentity(id), " has uploaded ", use.upload_bytes, " bytes today; ",
                     size_bytes, " more would exceed ", limits_.upload_bytes_per_day_max,
                     ", the limit of an identity a day; upload again after ", end,
                     ", or start the coordinator with a higher --upload-per-day-max"));
  }
  use.upload_bytes += size_bytes;
  return absl::OkStatus();
}

void IdentityUse::ReturnUpload(const IdentityId& id, uint64_t missing_bytes) {
  const MutexLock lock(&mutex_);
  Use& use = uses_[id];
  // Fewer than it reserved, if a new day has begun since.
  use.upload_bytes -= std::min(use.upload_bytes, missing_bytes);
}

void IdentityUse::NoteRefused(IdentityLimit limit) {
  const MutexLock lock(&mutex_);
  ++refused_[static_cast<size_t>(limit)];
}

std::array<uint64_t, kIdentityLimitCount> IdentityUse::Refused() const {
  const MutexLock lock(&mutex_);
  return refused_;
}

}  // namespace sheaf::coordinator
