// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SimulatedFarm, for tests: the real Scheduler, and workers that load scenes, keep some in memory,
// and take as long for samples as a table says. Without faults, and without a random number but
// those of the seed that vary the cost of leases. One event is the end of a task or a worker's call
// of Synchronize. Equal arguments give equal runs.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

// The cost of a scene for a worker.
struct SimulatedScene {
  const char* name;
  double load_seconds;        // Reading and compiling it.
  double seconds_per_sample;  // CPU time of a pixel sample.
};

struct SimulatedFarmOptions {
  int worker_count = 50;
  int thread_count = 2;  // Per worker.
  int leases_ahead = 2;
  size_t scenes_kept = 2;        // In a worker's memory; the least recently used one goes.
  double cost_deviation = 0.25;  // Log-normal, of the cost of a lease.
  uint64_t seed = 1;
};

class SimulatedFarm {
 public:
  static constexpr char kProfile[] = "simulated";

  SimulatedFarm(const Limits& limits, const SimulatedFarmOptions& options,
                std::vector<SimulatedScene> scenes)
      : options_(options), random_(options.seed), scheduler_(limits, 1) {
    for (const SimulatedScene& scene : scenes) scenes_.emplace(Sha256Hex(scene.name), scene);
    for (int i = 0; i < options.worker_count; ++i) {
      Worker& worker = workers_.emplace_back();
      worker.id = absl::StrCat("w", i);
      // They have started at different times.
      events_.insert({SteadyTime() + absl::Milliseconds(37 * i), i});
    }
  }

  // Frames of edge_px by edge_px pixels.
  void AddJob(uint64_t id, const std::string& scene, int frame_count, int32_t edge_px,
              uint64_t samples, int32_t priority = 0) {
    JobSpec job;
    job.job_id = id;
    job.priority = priority;
    job.numeric_profile = kProfile;
    job.partition = {64, 16, 0};
    for (int i = 1; i <= frame_count; ++i) {
      FrameSpec& frame = job.frames.emplace_back();
      frame.frame_number = i;
      frame.scene = {Sha256Hex(scene), 1};
      frame.settings.width_px = frame.settings.height_px = edge_px;
      frame.settings.window = {0, 0, edge_px, edge_px};
      frame.settings.samples = samples;
      frame.frame_digest = Sha256Hex(absl::StrCat("frame ", id, " ", i));
    }
    scheduler_.AddJob(job);
    added_[id] = now_;
  }

  // Plays until this time. Workers rest while there is nothing to do.
  void RunUntil(SteadyTime end) {
    while (!events_.empty() && events_.begin()->first <= end && live_jobs() > 0) {
      const auto [time, index] = *events_.begin();
      events_.erase(events_.begin());
      now_ = std::max(now_, time);
      Step(&workers_[static_cast<size_t>(index)], index);
    }
    now_ = std::max(now_, end);
  }

  int live_jobs() const { return static_cast<int>(added_.size() - ended_.size()); }
  SteadyTime now() const { return now_; }
  const Scheduler& scheduler() const { return scheduler_; }
  // When each job ended.
  const std::map<uint64_t, SteadyTime>& ended() const { return ended_; }
  SteadyTime last_end() const {
    SteadyTime last;
    for (const auto& [id, time] : ended_) last = std::max(last, time);
    return last;
  }
  // How often a worker began a frame that it had no lease of before.
  size_t frame_starts() const { return frame_starts_.size(); }
  // The longest time that a job waited for its first lease.
  absl::Duration longest_wait() const {
    absl::Duration longest;
    for (const auto& [id, job] : scheduler_.jobs()) {
      longest = std::max(longest, FirstLeaseTime(job) - added_.at(id));
    }
    return longest;
  }
  // From the time when a job was added to its end, on average.
  absl::Duration MeanJobDuration() const {
    absl::Duration sum;
    for (const auto& [id, time] : ended_) sum += time - added_.at(id);
    return ended_.empty() ? sum : sum / static_cast<int64_t>(ended_.size());
  }
  double load_seconds() const { return load_seconds_; }
  double render_seconds() const { return render_seconds_; }
  // How long leases took, in the order of their ends.
  const std::vector<double>& lease_seconds() const { return lease_seconds_; }
  // When each thread had its last task.
  std::vector<SteadyTime> last_ends() const {
    std::vector<SteadyTime> ends;
    for (const Worker& worker : workers_) {
      ends.insert(ends.end(), worker.thread_ends.begin(), worker.thread_ends.end());
    }
    return ends;
  }

 private:
  struct Running {
    SteadyTime begin, end;
    size_t thread = 0;
  };
  struct Worker {
    std::string id;
    std::vector<Lease> held;
    std::map<uint64_t, Running> running;      // By lease.
    std::map<std::string, SteadyTime> ready;  // Scenes in memory, and when they are loaded.
    std::vector<std::string> used;            // Those, the least recently used first.
    std::vector<SteadyTime> thread_ends;      // End of each thread's last task.
  };

  void Step(Worker* worker, int index) {
    FinishTasks(worker);
    WorkerReport report;
    report.worker_id = report.host = worker->id;
    report.numeric_profile = kProfile;
    report.thread_count = options_.thread_count;
    report.requested_lease_count = options_.thread_count + options_.leases_ahead;
    for (const Lease& lease : worker->held) {
      const bool runs = worker->running.contains(lease.lease_id);
      report.leases.push_back(
          {lease.lease_id, runs ? LeasePhase::kRendering : LeasePhase::kQueued});
    }
    report.warm_scenes = worker->used;
    const auto answer = scheduler_.Synchronize(report, now_);
    if (!answer.ok()) return;
    worker->held = answer->leases;
    std::erase_if(worker->running, [&](const auto& entry) {
      return std::none_of(worker->held.begin(), worker->held.end(),
                          [&](const Lease& lease) { return lease.lease_id == entry.first; });
    });
    for (const Lease& lease : worker->held) NoteGrant(*worker, lease);
    StartTasks(worker);
    SteadyTime wake = now_ + std::max(answer->next_synchronize, absl::Milliseconds(200));
    for (const auto& [id, running] : worker->running) wake = std::min(wake, running.end);
    events_.insert({std::max(wake, now_ + absl::Milliseconds(1)), index});
  }

  void NoteGrant(const Worker& worker, const Lease& lease) {
    if (lease.grant_time != now_) return;
    frame_starts_.insert({worker.id, lease.frame});
  }

  void FinishTasks(Worker* worker) {
    std::vector<Lease> done;
    for (const Lease& lease : worker->held) {
      const auto running = worker->running.find(lease.lease_id);
      if (running != worker->running.end() && running->second.end <= now_) done.push_back(lease);
    }
    for (const Lease& lease : done) {
      const Running running = worker->running.at(lease.lease_id);
      worker->running.erase(lease.lease_id);
      std::erase_if(worker->held, [&](const Lease& l) { return l.lease_id == lease.lease_id; });
      worker->thread_ends.resize(static_cast<size_t>(options_.thread_count));
      worker->thread_ends[running.thread] = running.end;
      const double seconds = absl::ToDoubleSeconds(running.end - running.begin);
      render_seconds_ += seconds;
      lease_seconds_.push_back(seconds);
      Deliver(lease, absl::Seconds(seconds));
    }
  }

  void Deliver(const Lease& lease, absl::Duration cpu_duration) {
    const FrameRecord* frame = scheduler_.FindFrame(lease.frame);
    if (frame == nullptr || frame->tasks == nullptr) return;
    if (frame->tasks->FitOf(lease.task) != FrameTasks::Fit::kWanted) return;
    const bool rendered = scheduler_.Accept(lease.frame, lease.task, lease.lease_id,
                                            lease.worker_id, {1, 0, cpu_duration}, now_);
    if (rendered && scheduler_.Deliver(lease.frame)) ended_[lease.frame.job_id] = now_;
  }

  void StartTasks(Worker* worker) {
    for (const Lease& lease : worker->held) {
      if (worker->running.size() >= static_cast<size_t>(options_.thread_count)) return;
      if (worker->running.contains(lease.lease_id)) continue;
      const FrameRecord& frame = *scheduler_.FindFrame(lease.frame);
      const std::string scene = frame.packed.scene().Hex();
      const double seconds = scenes_.at(scene).seconds_per_sample * CostFactor() *
                             static_cast<double>(frame.tasks->PixelSamples(lease.task));
      const SteadyTime begin = std::max(now_, Load(worker, scene));
      std::set<size_t> busy;
      for (const auto& [id, running] : worker->running) busy.insert(running.thread);
      size_t thread = 0;
      while (busy.contains(thread)) ++thread;
      worker->running[lease.lease_id] = {begin, begin + absl::Seconds(seconds), thread};
    }
  }

  // Returns when the scene is loaded.
  SteadyTime Load(Worker* worker, const std::string& scene) {
    std::erase(worker->used, scene);
    worker->used.push_back(scene);
    const auto [found, missing] = worker->ready.try_emplace(scene, now_);
    if (!missing) return found->second;
    const double seconds = scenes_.at(scene).load_seconds;
    load_seconds_ += seconds;
    found->second = now_ + absl::Seconds(seconds);
    if (worker->used.size() > options_.scenes_kept) {
      worker->ready.erase(worker->used.front());
      worker->used.erase(worker->used.begin());
    }
    return worker->ready.at(scene);
  }

  double CostFactor() {
    // A sum of 12 uniform values is nearly normal, and the same with every standard library.
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(random_() >> 11) * 0x1p-53;
    return std::exp(options_.cost_deviation * sum);
  }

  const SimulatedFarmOptions options_;
  std::mt19937_64 random_;
  std::map<std::string, SimulatedScene> scenes_;  // By digest.
  Scheduler scheduler_;
  SteadyTime now_;
  std::vector<Worker> workers_;
  std::multiset<std::pair<SteadyTime, int>> events_;
  std::map<uint64_t, SteadyTime> added_, ended_;
  std::set<std::pair<std::string, FrameId>> frame_starts_;
  double load_seconds_ = 0, render_seconds_ = 0;
  std::vector<double> lease_seconds_;
};

}  // namespace sheaf::coordinator
