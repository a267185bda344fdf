// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkState: the tables of the scheduler. Functions over it, in headers of their own, make its
// decisions (docs/adr/0142); each group of members names the one that keeps it.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/container/btree_map.h"
#include "absl/container/btree_set.h"
#include "absl/status/status.h"
#include "coordinator/core/frame/frame_tasks.h"
#include "coordinator/core/job/limits.h"
#include "coordinator/core/job/owner_work.h"
#include "coordinator/core/job/share_setting.h"
#include "coordinator/core/job/work_left.h"
#include "coordinator/scheduling/counters.h"
#include "coordinator/scheduling/dependencies.h"
#include "coordinator/scheduling/frames_by_digest.h"
#include "coordinator/scheduling/job_record.h"
#include "coordinator/scheduling/lease_table.h"
#include "coordinator/scheduling/loading_losses.h"
#include "coordinator/scheduling/packed_frame.h"
#include "coordinator/scheduling/pending_frames.h"
#include "coordinator/scheduling/placement/placement.h"
#include "coordinator/scheduling/result_checks.h"
#include "coordinator/scheduling/sharing/fair_share.h"
#include "coordinator/scheduling/sharing/held_threads.h"
#include "coordinator/scheduling/sharing/requirement_groups.h"
#include "coordinator/scheduling/task_failures.h"
#include "coordinator/scheduling/worker_table.h"

namespace sheaf::coordinator {

// Thread safety: none; the scheduler's owner holds one lock.
struct WorkState {
  WorkState(const Limits& limits_of_farm, uint64_t first_lease_id)
      : limits(limits_of_farm),
        workers(limits),
        leases(first_lease_id),
        sharing{FairShare(limits), {}, {}, {}},
        checking{ResultChecks(limits.result_versions_max), {}} {}
  WorkState(const WorkState&) = delete;
  WorkState& operator=(const WorkState&) = delete;

  const Limits limits;
  std::map<uint64_t, JobRecord> jobs;
  WorkerTable workers;
  LeaseTable leases;
  Counters counters;

  // frame_phases.h.
  FramesByDigest live_frames;
  std::set<FrameId> round_frames;  // Open, and rendered in rounds.
  int64_t open_pixels = 0;
  int live_job_count = 0;
  std::map<std::string, OwnerWork> owner_work;  // Work of live jobs, by owner.

  // share_limits.h.
  struct Sharing {
    FairShare order;  // Live jobs.
    HeldThreads held_threads;
    RequirementGroups groups;  // Live jobs.
    std::map<ShareSubject, ShareSetting> settings;
  } sharing;

  // placed_grants.h.
  struct Placing {
    std::map<std::string, std::set<uint64_t>> opened_jobs;  // With open frames, by numeric profile.
    WarmWorkers warm_workers;
    SceneJobs scene_jobs;  // Jobs with few scenes (placement_scenes_max).
  } placing;

  // check_leases.h.
  struct Checking {
    ResultChecks checks;
    std::map<FrameId, CheckWait> waits;
  } checking;

  // lease_failures.h and set_aside.h.
  struct Doubts {
    std::set<FrameId> frames;        // With a scene failure that is not yet confirmed.
    std::set<TaskId> tasks;          // With too many failures, not yet believed.
    std::set<FrameId> stuck_frames;  // Perhaps with only set-aside tasks left.
  } doubts;

  // work_holds.h.
  Dependents dependents;
  std::map<std::string, std::string> held_scenes;  // Reasons, by manifest digest.

  // Changes that the owner has not yet taken.
  struct News {
    std::vector<uint64_t> ended_jobs;
    std::set<uint64_t> failure_jobs;
    std::map<TaskId, TaskTrouble> troubles;
    std::vector<FrameId> incomplete_frames;
    std::vector<QuarantineRecord> quarantines;
  } news;
};

}  // namespace sheaf::coordinator
