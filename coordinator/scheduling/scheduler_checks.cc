// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that has results rendered again by other identities, to detect false ones.
#include <algorithm>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

void Scheduler::ConsiderCheck(const FrameId& id, const Task& task, const ResultVersion& merged,
                              double draw) {
  if (limits_.check_fraction <= 0) return;
  const bool is_new = workers_.ResultCount(merged.identity) <= limits_.new_identity_results;
  const double fraction =
      is_new ? std::max(limits_.new_identity_check_fraction, limits_.check_fraction)
             : limits_.check_fraction;
  const bool is_training = Frame(id).tasks->grid().KindOf(task.tile) == TaskKind::kTraining;
  if (draw >= fraction && !is_training) return;
  const JobRecord& job = jobs_.at(id.job_id);
  std::set<std::string> none_of_these = IdentitiesWithoutRoom(job);
  none_of_these.insert(merged.identity);
  if (!OtherIdentitiesLive(job.spec, none_of_these)) return;
  checks_.Begin(MakeTaskId(id, task), merged);
  ++counters_.checks_begun;
}

bool Scheduler::AnyMayCheck(const TaskId& task, bool proven_only) {
  const JobRecord& job = jobs_.at(task.frame.job_id);
  const ResultCheck& check = *checks_.Find(task);
  const std::set<std::string> without_room = IdentitiesWithoutRoom(job);
  int scanned = 0;
  return AnyIdentityFits(job.spec, [&](const std::string& identity) {
    if (!check.MayBeDoneBy(identity) || without_room.contains(identity)) return false;
    // Beyond the limit, some identity is assumed to have delivered results.
    if (++scanned > limits_.check_identities_scan_max) return true;
    return !proven_only || workers_.ResultCount(identity) > 0;
  });
}

bool Scheduler::MayCheck(const TaskId& task, const WorkerRecord& worker, bool urgent_only) {
  const FrameRecord& frame = Frame(task.frame);
  const ResultCheck* check = checks_.Find(task);
  if (check == nullptr || !check->MayBeDoneBy(worker.identity)) return false;
  if (!MayOpenFor(frame, worker) || AwaitsField(frame, task.tile)) return false;
  // All results rendered meanwhile depend on a field.
  const bool is_training = frame.tasks->grid().KindOf(task.tile) == TaskKind::kTraining;
  const bool is_urgent = is_training || frame.phase == FrameRecord::Phase::kRendered ||
                         worker.warm_scenes.contains(frame.packed.scene().Hex());
  if (urgent_only && !is_urgent) return false;
  // A stranger may hoard checks, and its results prove little.
  return workers_.ResultCount(worker.identity) > 0 || !AnyMayCheck(task, /*proven_only=*/true);
}

bool Scheduler::GrantCheck(WorkerRecord* worker, bool urgent_only, SteadyTime now) {
  int scanned = 0;
  for (const TaskId& id : checks_.waiting()) {
    if (++scanned > limits_.check_scan_max) return false;
    JobRecord& job = jobs_.at(id.frame.job_id);
    if (!job.MayLease() || job.spec.numeric_profile != worker->numeric_profile) continue;
    if (!MayServe(job, *worker) || !MayCheck(id, *worker, urgent_only)) continue;
    const TaskId taken = id;
    checks_.Lease(taken);
    AddLease(&job, &Frame(taken.frame), TaskOf(taken), worker, /*is_check=*/true, now);
    return true;
  }
  return false;
}

CheckVerdict Scheduler::Compare(const FrameId& id, const Task& task, uint64_t lease_id,
                                const std::string& worker_id, const ResultVersion& merged,
                                const ResultVersion& version, const ResultCost& cost,
                                SteadyTime now) {
  const TaskId task_id = MakeTaskId(id, task);
  const Lease* lease = leases_.Find(lease_id);
  if (lease != nullptr && lease->is_check && MakeTaskId(lease->frame, lease->task) == task_id) {
    const uint64_t samples = Frame(id).tasks->PixelSamples(task);
    counters_.samples_checked += samples;
    NoteDelivery(worker_id, samples, cost, lease->grant_time, now);
    ChargeResult(*lease, cost, now);
    DropLease(lease_id, /*put_back=*/true);
    if (const auto wait = check_waits_.find(id); wait != check_waits_.end()) {
      if (!wait->second.waits) wait->second = {now, now, now};
      wait->second.progress = now;
    }
  }
  CheckVerdict verdict = checks_.Add(task_id, merged, version);
  if (checks_.Find(task_id) == nullptr) DropCheckLeases(task_id);
  return verdict;
}

void Scheduler::DropCheckLeases(const TaskId& task) {
  for (const uint64_t holder : leases_.HoldersOf(task)) {
    if (!leases_.Find(holder)->is_check) continue;
    ++counters_.leases_cancelled;
    DropLease(holder, /*put_back=*/false);
  }
}

void Scheduler::DropChecks(const FrameId& id) {
  for (const TaskId& task : checks_.OfFrame(id)) {
    DropCheckLeases(task);
    ++counters_.checks_dropped;
  }
  checks_.EraseFrame(id);
  check_waits_.erase(id);
}

SteadyTime Scheduler::CheckWaitEnd(const TaskId& task, const CheckWait& wait) {
  const FrameRecord& frame = Frame(task.frame);
  const absl::Duration lease_target = absl::Seconds(limits_.lease_target_seconds);
  const absl::Duration frame_time =
      std::max(absl::ZeroDuration(), wait.begin - frame.first_lease_time);
  const bool is_training = frame.tasks->grid().KindOf(task.tile) == TaskKind::kTraining;
  const absl::Duration usual = is_training ? frame_time / limits_.check_wait_factor
                                           : ExpectedCpu(frame, TaskOf(task), lease_target);
  const auto patience = [&](absl::Duration expected) {
    return std::max(limits_.check_wait_min, limits_.check_wait_factor * expected);
  };
  const bool is_leased = checks_.Find(task)->leased;
  SteadyTime end = wait.progress;
  if (!is_leased && AnyMayCheck(task, /*proven_only=*/true)) {
    end += patience(std::max(usual, lease_target));  // They may be busy with other leases.
  } else if (is_leased || AnyMayCheck(task, /*proven_only=*/false)) {
    end += limits_.check_wait_min;  // Strangers get only this, however long a task takes.
  }
  for (const uint64_t id : leases_.HoldersOf(task)) {
    const Lease& held = *leases_.Find(id);
    if (workers_.ResultCount(held.identity) == 0) continue;
    end = std::max(end, wait.progress + patience(usual));
    const bool is_rendered = held.phase >= LeasePhase::kRendering;
    // The frame's workers have loaded its scene in that time.
    const absl::Duration loading =
        held.phase == LeasePhase::kLoading ? frame_time : absl::ZeroDuration();
    end = std::max(end, held.grant_time + loading +
                            patience(is_rendered ? usual : std::max(usual, lease_target)));
  }
  return std::min(end, wait.begin + limits_.check_wait_max);
}

bool Scheduler::AwaitsChecks(const FrameId& id, SteadyTime now) {
  const std::vector<TaskId> checks = checks_.OfFrame(id);
  if (checks.empty() || !jobs_.at(id.job_id).MayLease()) return false;
  const auto [found, is_new] = check_waits_.try_emplace(id, CheckWait{now, now, now});
  CheckWait& wait = found->second;
  if (!wait.waits) return false;
  wait.end = now;
  for (const TaskId& task : checks) wait.end = std::max(wait.end, CheckWaitEnd(task, wait));
  wait.waits = now < wait.end;
  return wait.waits;
}

std::string Scheduler::WhyAwaitsChecks(const FrameId& id) const {
  const auto wait = check_waits_.find(id);
  const size_t count = checks_.OfFrame(id).size();
  if (wait == check_waits_.end() || !wait->second.waits || count == 0) return "";
  return absl::StrCat("waits for checks: other workers render ", count,
                      count == 1 ? " result" : " results", " again, to compare");
}

}  // namespace sheaf::coordinator
