// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/waiting_reason.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/memory_room.h"
#include "coordinator/scheduling/check_leases.h"
#include "coordinator/scheduling/lease_failures.h"
#include "coordinator/scheduling/lease_grants.h"
#include "coordinator/scheduling/share_limits.h"

namespace sheaf::coordinator::scheduling {
namespace {

std::string WhatEndsTheWait(const WorkState& state, const JobRecord& job,
                            const FrameRecord& frame) {
  const int live = state.workers.LiveCount(job.spec.numeric_profile);
  return absl::StrCat("; to end the wait: another worker, sheaf retry jobs/", job.spec.job_id,
                      ", or sheaf kill jobs/", job.spec.job_id, " --frame ", frame.number(),
                      "; if no other worker will join the farm, sheaf-coordinator "
                      "--poison-workers ",
                      live);
}

// Names the failures that keep the present workers from the job's tasks; empty if there are none.
std::string WhyOthersAreNeeded(const WorkState& state, const JobRecord& job) {
  int scanned = 0;
  for (const uint32_t index : job.ready) {
    if (++scanned > state.limits.avoid_scan_max) break;
    const FrameRecord& frame = job.frames[index];
    std::set<std::string> refused;
    for (const auto& [worker, kind] : frame.refused_by) refused.insert(worker);
    const auto nobody_is_left = [&](const std::set<std::string>& failed) {
      return !failed.empty() && !OthersLive(state, job.spec, failed);
    };
    if (nobody_is_left(refused)) {
      const auto& [worker, kind] = *frame.refused_by.begin();
      return absl::StrCat(
          "waiting for another worker: ", worker, " failed frame ", frame.number(), " by ",
          FailureKindText(kind),
          refused.size() == 1 ? "" : absl::StrCat(", and so did ", refused.size() - 1, " others"),
          WhatEndsTheWait(state, job, frame));
    }
    for (const auto& [id, failures] : frame.failures) {
      if (!failures.trouble.set_aside.empty()) continue;
      std::set<std::string> failed = refused;
      std::string text;
      for (const TaskFailure& failure : failures.trouble.failures) {
        if (!IsOwnFailure(failure.kind)) continue;
        failed.insert(failure.worker_id);
        absl::StrAppend(&text, text.empty() ? "" : ", ", failure.worker_id,
                        text.empty() ? " failed this task by " : " by ",
                        FailureKindText(failure.kind));
      }
      if (text.empty() || !nobody_is_left(failed)) continue;
      return absl::StrCat(
          "waiting for another worker: ", text, " (frame ", frame.number(), ", ",
          WorkText(failures.trouble.kind, failures.trouble.tile, failures.trouble.block), ")",
          WhatEndsTheWait(state, job, frame));
    }
  }
  return "";
}

// Empty if not known.
// Even while one of the workers retries.
std::string WhyNoCacheHolds(const WorkState& state, const JobRecord& job) {
  std::set<std::string> refused;
  uint64_t needed_bytes = 0, room_bytes = 0;
  for (const auto& [id, refusal] : job.cache_refusals) {
    const auto worker = state.workers.workers().find(id);
    if (worker == state.workers.workers().end() || !worker->second.Live()) continue;
    refused.insert(id);
    needed_bytes = std::max(needed_bytes, refusal.needed_bytes);
    room_bytes = std::max(room_bytes, refusal.room_bytes);
  }
  if (refused.empty() || OthersLive(state, job.spec, refused)) return "";
  return absl::StrCat("needs ", FormatMemory(needed_bytes), " of scene cache; workers have ",
                      FormatMemory(room_bytes), refused.size() == 1 ? "" : " at most",
                      " (sheaf-worker --cache-bytes-max, --cache-dir, and the disk's free space)");
}

}  // namespace

std::string WaitingReason(const WorkState& state, const JobRecord& job) {
  if (job.phase != JobPhase::kLive || job.Paused()) return "";
  if (std::string why = WhyNoCacheHolds(state, job); !why.empty()) return why;
  const std::vector<uint64_t> leases = state.leases.OfJob(job.spec.job_id);
  if (!std::ranges::all_of(leases, [&](uint64_t id) { return state.leases.Find(id)->is_check; })) {
    return "";
  }
  const FrameId first{job.spec.job_id, INT32_MIN};
  for (auto wait = state.checking.waits.lower_bound(first);
       job.ready.empty() && wait != state.checking.waits.end() &&
       wait->first.job_id == first.job_id;
       ++wait) {
    if (std::string why = WhyAwaitsChecks(state, wait->first); !why.empty()) return why;
  }
  if (!leases.empty()) return "";
  if (std::string why = WhyHeld(state.jobs, job); !why.empty()) return why;
  for (const FrameRecord& frame : job.frames) {
    if (state.held_scenes.empty()) break;
    const bool waits =
        frame.phase == FrameRecord::Phase::kPending || frame.phase == FrameRecord::Phase::kOpen;
    if (waits && IsHeld(state, frame)) return state.held_scenes.at(frame.packed.scene().Hex());
  }
  if (state.workers.LiveCount(job.spec.numeric_profile) > 0) {
    const std::string why = WhyNobodyMay(state, job);
    return why.empty() ? WhyOthersAreNeeded(state, job) : why;
  }
  std::string other;
  bool some_are_sick = false, some_are_drained = false;
  for (const auto& [id, worker] : state.workers.workers()) {
    some_are_sick |= worker.Sick() && !worker.lost;
    some_are_drained |= worker.drained && !worker.draining && !worker.lost;
    if (!worker.Live()) continue;
    other = worker.numeric_profile;
    break;
  }
  if (state.workers.LiveCount() == 0) {
    return some_are_sick      ? "all connected workers are sick; sheaf workers says why"
           : some_are_drained ? "all connected workers are drained; sheaf undrain gives them work"
                              : "no worker is connected";
  }
  return absl::StrCat("no worker of the job's numeric profile \"", job.spec.numeric_profile,
                      "\" is connected; the connected workers have \"", other, "\"");
}

}  // namespace sheaf::coordinator::scheduling
