// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SchedulerTest, for tests: a Scheduler, small jobs, and workers that report what they hold.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

inline constexpr char kProfile[] = "profile";

inline std::string Digest(uint64_t number) { return Sha256Hex(absl::StrCat(number)); }

// Limits by which new workers get what they ask for.
inline Limits TrustingLimits() {
  Limits limits;
  limits.unproven_leases_min = limits.leases_per_worker_max;
  return limits;
}

class SchedulerTest : public ::testing::Test {
 protected:
  explicit SchedulerTest(const Limits& limits = TrustingLimits()) : limits_(limits) {}

  FrameSpec Frame(int32_t number, const std::string& scene, uint64_t digest) {
    FrameSpec frame;
    frame.frame_number = number;
    frame.scene = {Sha256Hex(scene), 1};
    frame.settings.width_px = frame.settings.height_px = 64;
    frame.settings.window = {0, 0, 64, 64};
    frame.settings.samples = 64;
    frame.frame_digest = Digest(digest);
    return frame;
  }
  // A job of frames of four tiles with four passes each.
  uint64_t AddJob(int frame_count = 1, int32_t priority = 0, const StopRule& stop = {}) {
    JobSpec job;
    job.job_id = ++last_job_id_;
    job.priority = priority;
    job.numeric_profile = kProfile;
    job.partition = {32, 16, 1};
    for (int i = 1; i <= frame_count; ++i) {
      job.frames.push_back(
          Frame(i, absl::StrCat("scene", job.job_id, "-", i), job.job_id * 100 + i));
      job.frames.back().stop = stop;
    }
    EXPECT_TRUE(scheduler_.CheckJob(job).ok());
    scheduler_.AddJob(job);
    return job.job_id;
  }

  // The leases that worker `id` holds after a Synchronize; it reports those that it held before,
  // rendering the first.
  const std::vector<Lease>& Sync(const std::string& id, int wanted) {
    WorkerReport report;
    report.worker_id = report.host = id;
    report.identity = identities_[id];
    report.numeric_profile = kProfile;
    report.requested_lease_count = wanted;
    for (const Lease& lease : held_[id]) {
      const bool first = report.leases.empty();
      report.leases.push_back(
          {lease.lease_id, first ? LeasePhase::kRendering : LeasePhase::kQueued});
    }
    report.failures = failures_[id];
    report.draining = draining_;
    report.warm_scenes = warm_;
    failures_[id].clear();
    const absl::StatusOr<Scheduler::SynchronizeAnswer> answer =
        scheduler_.Synchronize(report, now_);
    status_ = answer.status();
    next_synchronize_ = answer.ok() ? answer->next_synchronize : absl::InfiniteDuration();
    held_[id] = answer.ok() ? answer->leases : std::vector<Lease>{};
    return held_[id];
  }
  Scheduler::FoundTask Find(const Lease& lease) {
    return scheduler_.FindTask(scheduler_.FindFrame(lease.frame)->Spec().frame_digest,
                               lease.tile_rect, lease.task.block, lease.cells, lease.lease_id);
  }
  // By value, for the lease leaves the list from which it may come.
  bool Accept(Lease lease) {
    EXPECT_EQ(Find(lease).kind, Scheduler::FoundTask::Kind::kWanted);
    std::erase_if(held_[lease.worker_id],
                  [&](const Lease& l) { return l.lease_id == lease.lease_id; });
    return scheduler_.Accept(lease.frame, lease.task, lease.lease_id, lease.worker_id,
                             {1, 0, absl::Milliseconds(1)}, now_);
  }
  void Fail(Lease lease, FailureKind kind, const std::string& message = "broken") {
    std::erase_if(held_[lease.worker_id],
                  [&](const Lease& l) { return l.lease_id == lease.lease_id; });
    failures_[lease.worker_id].push_back({lease.lease_id, kind, message});
  }
  const JobRecord& Job(uint64_t id) { return scheduler_.jobs().at(id); }

  const Limits limits_;
  Scheduler scheduler_{limits_, 1000};
  SteadyTime now_;
  uint64_t last_job_id_ = 0;
  absl::Status status_;
  absl::Duration next_synchronize_;
  bool draining_ = false;
  std::vector<std::string> warm_;
  std::map<std::string, std::string> identities_;  // By worker; empty: itself.
  std::map<std::string, std::vector<Lease>> held_;
  std::map<std::string, std::vector<LeaseFailure>> failures_;
};

}  // namespace sheaf::coordinator
