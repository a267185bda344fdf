// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DirectUpload: stores the bytes of results in the farm's object store, by tickets that the
// coordinator gives, so that they do not pass through the coordinator twice. Where that fails, the
// results go to the coordinator for a while.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "common/objects/http_client.h"
#include "common/objects/object_store.h"
#include "worker/agent/work.h"

namespace sheaf::worker {

// Smaller results go to the coordinator: two more calls would take longer than their bytes.
inline constexpr uint64_t kDirectUploadBytesMin = uint64_t{16} << 10;
inline constexpr int kDirectUploadAttemptsMax = 3;
inline constexpr absl::Duration kDirectUploadBackoff = absl::Milliseconds(200);  // Doubling.
// After a failure results go to the coordinator for so long.
inline constexpr absl::Duration kDirectUploadPause = absl::Minutes(1);

// Thread safety: all members may be called concurrently.
class DirectUpload {
 public:
  // A ticket per result, with an empty URL for those that the coordinator takes itself.
  using Plan = std::function<absl::StatusOr<std::vector<PutTicket>>(
      const std::vector<const FinishedPart*>& parts)>;

  explicit DirectUpload(std::string ca_file) : http_(std::move(ca_file)) {}

  // Whether the coordinator wants results to be stored directly.
  void SetWanted(bool is_wanted) { is_wanted_ = is_wanted; }
  // Says of each result whether its bytes are stored now.
  std::vector<bool> Store(const std::vector<const FinishedPart*>& parts, const Plan& plan);
  // The coordinator did not find what was stored, or the store cannot be reached.
  void Pause(const std::string& why);
  // Ends what runs, and stores nothing from now on.
  void Abort() { is_aborted_ = true; }

 private:
  absl::Status Put(const PutTicket& ticket, const std::string& bytes);
  bool IsPaused();

  HttpClient http_;
  std::atomic<bool> is_wanted_{false}, is_aborted_{false};
  Mutex mutex_;
  SteadyTime pause_end_ ABSL_GUARDED_BY(mutex_) = SteadyTime::InfinitePast();
};

}  // namespace sheaf::worker
