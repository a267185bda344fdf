// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobWatches: the changes of watched jobs, computed once for all watchers. A watcher gets the
// changes since its last message, so that it costs little even for a job of 100,000 frames.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "coordinator/service/farm/farm.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf::coordinator {

// Between two looks at a job.
inline constexpr absl::Duration kWatchIntervalMin = absl::Milliseconds(200);
// Computing the changes of a job with many frames takes time: at most this fraction of a processor.
inline constexpr int kLookFraction = 20;  // 1 / 20.

// One job, for all who watch it. Thread safety: all members may be called concurrently.
class JobWatch {
 public:
  // farm must outlive the object.
  JobWatch(Farm* farm, std::string job_id) : farm_(*farm), job_id_(std::move(job_id)) {}

  // The job if it has changed since *version, which is 0 at first; none otherwise. changes_only:
  // includes only the frames changed since, except the first time. Sets *version.
  // Errors: kNotFound.
  absl::StatusOr<std::optional<v1::Job>> Next(uint64_t* version, bool changes_only);
  // How often the job was looked at, for tests.
  uint64_t look_count() const { return look_count_; }

 private:
  struct KnownFrame {
    v1::Frame frame;
    std::vector<v1::FrameTrouble> troubles;
    uint64_t version = 0;  // In which it changed last.
  };
  absl::Status Look() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  Farm& farm_;
  const std::string job_id_;
  std::atomic<uint64_t> look_count_{0};
  Mutex mutex_;
  uint64_t version_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t changes_seen_ ABSL_GUARDED_BY(mutex_) = 0;  // Farm::ChangeCount.
  SteadyTime next_look_ ABSL_GUARDED_BY(mutex_) = SteadyTime::InfinitePast();
  FrameMarks marks_ ABSL_GUARDED_BY(mutex_);
  v1::Job job_ ABSL_GUARDED_BY(mutex_);  // Without frames.
  std::map<int32_t, KnownFrame> frames_ ABSL_GUARDED_BY(mutex_);
};

// Thread safety: all members may be called concurrently.
class JobWatches {
 public:
  // farm must outlive the object and all watches.
  explicit JobWatches(Farm* farm) : farm_(farm) {}
  // The job's watch, shared by its watchers.
  std::shared_ptr<JobWatch> Of(const std::string& job_id);

 private:
  Farm* const farm_;
  Mutex mutex_;
  std::map<std::string, std::weak_ptr<JobWatch>> watches_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::coordinator
