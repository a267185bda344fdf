// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// IdentityUse: each identity's use of a coordinator with certificates, and the limits beyond which
// it is refused, so that no user or worker starves the others, by mistake or on purpose (ADR 62).
// coordinator/core/job/owner_work.h has the limits of unfinished jobs. Counts are in memory only: a
// restart of the coordinator resets them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "coordinator/access/identity.h"

namespace sheaf::coordinator {

// Each is far above normal use.
struct IdentityLimits {
  // Calls of an identity, over gRPC and HTTP together: a burst, and then a rate.
  double calls_per_second_max = 1000;
  double calls_burst_max = 5000;
  // Calls of one address (peer_network.h) by callers that show no identity: enrolments and HTTP.
  double stranger_calls_per_second_max = 20;
  double stranger_calls_burst_max = 200;
  // Streaming calls open at once: uploads, downloads, watches. Each takes a thread. All workers of
  // a machine share its identity.
  int64_t user_streams_max = 200;
  int64_t worker_streams_max = 1000;
  // Bytes of scenes that an identity uploads within a day.
  uint64_t upload_bytes_per_day_max = uint64_t{1} << 40;
};
// Addresses of strangers that are counted separately. Beyond the limit all are forgotten, which
// gives each a new burst; this bounds the cost.
inline constexpr size_t kStrangerAddressesMax = 10'000;

// The limits for which calls are refused; each has a counter.
enum class IdentityLimit {
  kCalls,
  kStrangerCalls,
  kStreams,
  kUploadBytes,
  kConnections,
  kStoredBytes,  // Decided by the farm (coordinator/core/policy/owner_bytes.h).
};
inline constexpr size_t kIdentityLimitCount = 6;
// Returns "calls", "stranger_calls", "streams", "upload_bytes", "connections" or "stored_bytes".
const char* IdentityLimitName(IdentityLimit limit);

// Thread safety: all members may be called concurrently. Every refusal is kResourceExhausted; its
// message names the limit and says what to do.
class IdentityUse {
 public:
  explicit IdentityUse(const IdentityLimits& limits) : limits_(limits) {}
  IdentityUse(const IdentityUse&) = delete;
  IdentityUse& operator=(const IdentityUse&) = delete;

  // Counts a call. Errors: kResourceExhausted, which says when it passes (retry_after.h).
  absl::Status NoteCall(const IdentityId& id, absl::Time now);
  // The same for a caller without an identity. address: without its port.
  absl::Status NoteStrangerCall(const std::string& address, absl::Time now);

  // Counts an open stream until it is destroyed. Movable.
  class Stream {
   public:
    Stream() = default;
    Stream(Stream&& other) noexcept : use_(other.use_), id_(std::move(other.id_)) {
      other.use_ = nullptr;
    }
    Stream& operator=(Stream&&) = delete;
    ~Stream() {
      if (use_ != nullptr) use_->CloseStream(id_);
    }

   private:
    friend class IdentityUse;
    Stream(IdentityUse* use, IdentityId id) : use_(use), id_(std::move(id)) {}
    IdentityUse* use_ = nullptr;
    IdentityId id_;
  };
  // Errors: kResourceExhausted. The object must outlive the stream.
  absl::StatusOr<Stream> OpenStream(const IdentityId& id);

  // Counts all bytes of an upload that begins. Errors: kResourceExhausted; then it is not counted.
  absl::Status BeginUpload(const IdentityId& id, uint64_t size_bytes, absl::Time now);
  // Returns the bytes that an upload did not send.
  void ReturnUpload(const IdentityId& id, uint64_t missing_bytes);

  // Counts a refusal that is decided elsewhere.
  void NoteRefused(IdentityLimit limit);
  // Refusals since the start, by IdentityLimit.
  std::array<uint64_t, kIdentityLimitCount> Refused() const;

 private:
  // A bucket of tokens that fills with time; a call takes one.
  struct Bucket {
    double left = 0;
    absl::Time time = absl::InfinitePast();  // A first call finds a full bucket.
    bool Take(double rate, double burst, absl::Time now);
  };
  struct Use {
    Bucket calls;
    int64_t streams = 0;
    uint64_t upload_bytes = 0;
    absl::Time day_begin = absl::InfinitePast();
  };
  absl::Status Refuse(IdentityLimit limit, const std::string& message)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Bucket& BucketOf(const std::string& network) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void CloseStream(const IdentityId& id);

  const IdentityLimits limits_;
  mutable Mutex mutex_;
  std::map<IdentityId, Use> uses_ ABSL_GUARDED_BY(mutex_);           // At most one per identity.
  std::map<std::string, Bucket> strangers_ ABSL_GUARDED_BY(mutex_);  // By PeerNetwork.
  std::array<uint64_t, kIdentityLimitCount> refused_ ABSL_GUARDED_BY(mutex_){};
};

}  // namespace sheaf::coordinator
