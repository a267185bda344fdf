// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/check_leases.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/frame_phases.h"
#include "coordinator/scheduling/lease_failures.h"
#include "coordinator/scheduling/lease_grants.h"
#include "coordinator/scheduling/share_limits.h"

namespace sheaf::coordinator::scheduling {
namespace {

// Whether any live identity may do the check; with proven_only, any that has delivered results.
bool AnyMayCheck(WorkState& state, const TaskId& task, bool proven_only) {
  const JobRecord& job = state.jobs.at(task.frame.job_id);
  const ResultCheck& check = *state.checking.checks.Find(task);
  const std::set<std::string> without_room = IdentitiesWithoutRoom(state, job);
  int scanned = 0;
  return AnyIdentityFits(state, job.spec, [&](const std::string& identity) {
    if (!check.MayBeDoneBy(identity) || without_room.contains(identity)) return false;
    // Beyond the limit, some identity is assumed to have delivered results.
    if (++scanned > state.limits.check_identities_scan_max) return true;
    return !proven_only || state.workers.ResultCount(identity) > 0;
  });
}

SteadyTime CheckWaitEnd(WorkState& state, const TaskId& task, const CheckWait& wait) {
  const FrameRecord& frame = Frame(state, task.frame);
  const absl::Duration lease_target = absl::Seconds(state.limits.lease_target_seconds);
  const absl::Duration frame_time =
      std::max(absl::ZeroDuration(), wait.begin - frame.first_lease_time);
  const bool is_training = frame.tasks->grid().KindOf(task.tile) == TaskKind::kTraining;
  const absl::Duration usual = is_training ? frame_time / state.limits.check_wait_factor
                                           : ExpectedCpu(frame, TaskOf(task), lease_target);
  const auto patience = [&](absl::Duration expected) {
    return std::max(state.limits.check_wait_min, state.limits.check_wait_factor * expected);
  };
  const bool is_leased = state.checking.checks.Find(task)->leased;
  SteadyTime end = wait.progress;
  if (!is_leased && AnyMayCheck(state, task, /*proven_only=*/true)) {
    end += patience(std::max(usual, lease_target));  // They may be busy with other leases.
  } else if (is_leased || AnyMayCheck(state, task, /*proven_only=*/false)) {
    end += state.limits.check_wait_min;  // Strangers get only this, however long a task takes.
  }
  for (const uint64_t id : state.leases.HoldersOf(task)) {
    const Lease& held = *state.leases.Find(id);
    if (state.workers.ResultCount(held.identity) == 0) continue;
    end = std::max(end, wait.progress + patience(usual));
    const bool is_rendered = held.phase >= LeasePhase::kRendering;
    // The frame's workers have loaded its scene in that time.
    const absl::Duration loading =
        held.phase == LeasePhase::kLoading ? frame_time : absl::ZeroDuration();
    end = std::max(end, held.grant_time + loading +
                            patience(is_rendered ? usual : std::max(usual, lease_target)));
  }
  return std::min(end, wait.begin + state.limits.check_wait_max);
}

}  // namespace

void ConsiderCheck(WorkState& state, const FrameId& id, const Task& task,
                   const ResultVersion& merged, double draw) {
  if (state.limits.check_fraction <= 0) return;
  const bool is_new =
      state.workers.ResultCount(merged.identity) <= state.limits.new_identity_results;
  const double fraction =
      is_new ? std::max(state.limits.new_identity_check_fraction, state.limits.check_fraction)
             : state.limits.check_fraction;
  const bool is_training = Frame(state, id).tasks->grid().KindOf(task.tile) == TaskKind::kTraining;
  if (draw >= fraction && !is_training) return;
  const JobRecord& job = state.jobs.at(id.job_id);
  std::set<std::string> none_of_these = IdentitiesWithoutRoom(state, job);
  none_of_these.insert(merged.identity);
  if (!OtherIdentitiesLive(state, job.spec, none_of_these)) return;
  state.checking.checks.Begin(MakeTaskId(id, task), merged);
  ++state.counters.checks_begun;
}

bool MayCheck(WorkState& state, const TaskId& task, const WorkerRecord& worker, bool urgent_only) {
  const FrameRecord& frame = Frame(state, task.frame);
  const ResultCheck* check = state.checking.checks.Find(task);
  if (check == nullptr || !check->MayBeDoneBy(worker.identity)) return false;
  if (!MayOpenFor(state, frame, worker) || AwaitsField(frame, task.tile)) return false;
  // All results rendered meanwhile depend on a field.
  const bool is_training = frame.tasks->grid().KindOf(task.tile) == TaskKind::kTraining;
  const bool is_urgent = is_training || frame.phase == FrameRecord::Phase::kRendered ||
                         worker.warm_scenes.contains(frame.packed.scene().Hex());
  if (urgent_only && !is_urgent) return false;
  // A stranger may hoard checks, and its results prove little.
  return state.workers.ResultCount(worker.identity) > 0 ||
         !AnyMayCheck(state, task, /*proven_only=*/true);
}

bool GrantCheck(WorkState& state, WorkerRecord* worker, bool urgent_only, SteadyTime now) {
  int scanned = 0;
  for (const TaskId& id : state.checking.checks.waiting()) {
    if (++scanned > state.limits.check_scan_max) return false;
    JobRecord& job = state.jobs.at(id.frame.job_id);
    if (!job.MayLease() || job.spec.numeric_profile != worker->numeric_profile) continue;
    if (!MayServe(state, job, *worker) || !MayCheck(state, id, *worker, urgent_only)) continue;
    const TaskId taken = id;
    state.checking.checks.Lease(taken);
    AddLease(state, &job, &Frame(state, taken.frame), TaskOf(taken), worker, /*is_check=*/true,
             now);
    return true;
  }
  return false;
}

CheckVerdict Compare(WorkState& state, const FrameId& id, const Task& task, uint64_t lease_id,
                     const std::string& worker_id, const ResultVersion& merged,
                     const ResultVersion& version, const ResultCost& cost, SteadyTime now) {
  const TaskId task_id = MakeTaskId(id, task);
  const Lease* lease = state.leases.Find(lease_id);
  if (lease != nullptr && lease->is_check && MakeTaskId(lease->frame, lease->task) == task_id) {
    const uint64_t samples = Frame(state, id).tasks->PixelSamples(task);
    state.counters.samples_checked += samples;
    NoteDelivery(state, worker_id, samples, cost, lease->grant_time, now);
    ChargeResult(state, *lease, cost, now);
    DropLease(state, lease_id, /*put_back=*/true);
    if (const auto wait = state.checking.waits.find(id); wait != state.checking.waits.end()) {
      if (!wait->second.waits) wait->second = {now, now, now};
      wait->second.progress = now;
    }
  }
  CheckVerdict verdict = state.checking.checks.Add(task_id, merged, version);
  if (state.checking.checks.Find(task_id) == nullptr) DropCheckLeases(state, task_id);
  return verdict;
}

void DropCheckLeases(WorkState& state, const TaskId& task) {
  for (const uint64_t holder : state.leases.HoldersOf(task)) {
    if (!state.leases.Find(holder)->is_check) continue;
    ++state.counters.leases_cancelled;
    DropLease(state, holder, /*put_back=*/false);
  }
}

void DropChecks(WorkState& state, const FrameId& id) {
  for (const TaskId& task : state.checking.checks.OfFrame(id)) {
    DropCheckLeases(state, task);
    ++state.counters.checks_dropped;
  }
  state.checking.checks.EraseFrame(id);
  state.checking.waits.erase(id);
}

bool AwaitsChecks(WorkState& state, const FrameId& id, SteadyTime now) {
  const std::vector<TaskId> checks = state.checking.checks.OfFrame(id);
  if (checks.empty() || !state.jobs.at(id.job_id).MayLease()) return false;
  const auto [found, is_new] = state.checking.waits.try_emplace(id, CheckWait{now, now, now});
  CheckWait& wait = found->second;
  if (!wait.waits) return false;
  wait.end = now;
  for (const TaskId& task : checks) wait.end = std::max(wait.end, CheckWaitEnd(state, task, wait));
  wait.waits = now < wait.end;
  return wait.waits;
}

std::string WhyAwaitsChecks(const WorkState& state, const FrameId& id) {
  const auto wait = state.checking.waits.find(id);
  const size_t count = state.checking.checks.OfFrame(id).size();
  if (wait == state.checking.waits.end() || !wait->second.waits || count == 0) return "";
  return absl::StrCat("waits for checks: other workers render ", count,
                      count == 1 ? " result" : " results", " again, to compare");
}

void NoteDelivery(WorkState& state, const std::string& worker_id, uint64_t samples,
                  const ResultCost& cost, SteadyTime grant_time, SteadyTime now) {
  WorkerRecord* worker = state.workers.Find(worker_id);
  if (worker == nullptr) return;
  state.workers.NoteResult(worker->identity);
  ++worker->result_count;
  worker->sample_count += samples;
  // A training has no samples, so it does not measure the worker's speed.
  if (samples > 0) worker->cpu_duration += cost.cpu_duration;
  if (grant_time <= worker->last_result_time) {
    worker->busy_duration += now - worker->last_result_time;
    worker->busy_cpu_duration += cost.cpu_duration;
  }
  worker->last_result_time = now;
  worker->infrastructure_failures = 0;
}

}  // namespace sheaf::coordinator::scheduling
