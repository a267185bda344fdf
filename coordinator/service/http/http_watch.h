// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Turns "something changed" into events about what changed: compares the farm with how it looked
// before and publishes each job, frame and worker that differs.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <thread>

#include "coordinator/service/http/event_stream.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// Looks at the farm at most this often, and rests four times the CPU time that a look took, so that
// a farm with very many jobs gives at most a fifth of one processor to being watched.
inline constexpr std::chrono::milliseconds kWatchInterval{200};
inline constexpr int kWatchRestFactor = 4;
// How long a stop may have to wait.
inline constexpr std::chrono::milliseconds kWatchWait{250};

// The comparison alone; time and threads are FarmWatcher's business.
// Thread safety: from one thread at a time.
class FarmDifference {
 public:
  explicit FarmDifference(EventHub* hub) : hub_(hub) {}
  // Publishes what differs from the last call. The first call publishes everything that is there.
  void Publish(const FarmView& farm);

 private:
  // The properties of an object whose changes viewers are told of, as text.
  using Marks = std::map<std::string, std::string>;
  void PublishFrames(const FarmView& farm, const std::string& job_id);

  EventHub* const hub_;
  Marks jobs_;
  Marks workers_;
  // By job, for jobs that have changed since somebody watches.
  std::map<std::string, Marks> frames_;
};

// Runs FarmDifference on a thread of its own until destroyed.
class FarmWatcher {
 public:
  // `farm` and `hub` must outlive the object.
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
