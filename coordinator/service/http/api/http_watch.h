// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Watches a farm and publishes its changes as events: compares its state with the previous one, and
// publishes each job, frame and worker that differs.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "coordinator/service/http/server/event_stream.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// Minimum time between two comparisons. After each one the watcher also pauses for four times its
// CPU time, so that even for very many jobs it uses at most a fifth of one processor.
inline constexpr std::chrono::milliseconds kWatchInterval{200};
inline constexpr int kWatchRestFactor = 4;
// Maximum time that stopping the watcher takes.
inline constexpr std::chrono::milliseconds kWatchWait{250};

// The comparison, without threads and timing. Thread safety: one thread at a time.
class FarmDifference {
 public:
  explicit FarmDifference(EventHub* hub) : hub_(hub) {}
  // Publishes the differences from the last call. The first call publishes everything.
  void Publish(const FarmView& farm);

 private:
  // Keys of objects and, as text, the properties whose changes are published.
  using Marks = std::map<std::string, std::string>;
  void PublishFrames(const FarmView& farm, const std::string& job_id);
  // Publishes removals: of jobs that were removed, and of workers that are no longer listed.
  template <typename View>
  void PublishRemoved(const std::string& kind, const std::vector<View>& present,
                      std::string View::*id, Marks* marks);

  EventHub* const hub_;
  Marks jobs_;
  Marks workers_;
  // By job, for jobs that have changed since there are readers.
  std::map<std::string, Marks> frames_;
  std::map<std::string, FrameMarks> seen_;  // By job: frames that need no comparison.
};

// Runs FarmDifference in its own thread until destroyed.
class FarmWatcher {
 public:
  // `farm` and `hub` must outlive this object.
  FarmWatcher(const FarmView& farm, EventHub* hub);
  ~FarmWatcher();
  FarmWatcher(const FarmWatcher&) = delete;
  FarmWatcher& operator=(const FarmWatcher&) = delete;

 private:
  void Run();

  const FarmView& farm_;
  FarmDifference difference_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace sheaf::coordinator
