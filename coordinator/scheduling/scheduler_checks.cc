// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that has results rendered again by others, to notice false ones.
#include <algorithm>
#include <set>
#include <string>

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

bool Scheduler::GrantCheck(WorkerRecord* worker, bool urgent_only, SteadyTime now) {
  int scanned = 0;
  for (const TaskId& id : checks_.waiting()) {
    if (++scanned > limits_.check_scan_max) return false;
    JobRecord& job = jobs_.at(id.frame.job_id);
    FrameRecord& frame = Frame(id.frame);
    if (!job.MayLease() || job.spec.numeric_profile != worker->numeric_profile) continue;
    if (!MayOpenFor(frame, *worker) || AwaitsField(frame, id.tile)) continue;
    if (!MayServe(job, *worker)) continue;
    if (!checks_.Find(id)->MayBeDoneBy(worker->identity)) continue;
    // All that is rendered meanwhile depends on a field.
    const bool is_training = frame.tasks->grid().KindOf(id.tile) == TaskKind::kTraining;
    const bool is_urgent = is_training || frame.phase == FrameRecord::Phase::kRendered ||
                           worker->warm_scenes.contains(frame.packed.scene().Hex());
    if (urgent_only && !is_urgent) continue;
    const TaskId taken = id;
    checks_.Lease(taken);
    AddLease(&job, &frame, {taken.tile, {taken.first, taken.count}, taken.cells}, worker,
             /*is_check=*/true, now);
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
  check_wait_ends_.erase(id);
}

bool Scheduler::AwaitsChecks(const FrameId& id, SteadyTime now) {
  const std::vector<TaskId> checks = checks_.OfFrame(id);
  const JobRecord& job = jobs_.at(id.job_id);
  if (checks.empty() || !job.MayLease()) return false;
  const auto [wait_end, is_new] = check_wait_ends_.try_emplace(id, now + limits_.check_wait_max);
  if (now >= wait_end->second) return false;
  const std::set<std::string> without_room = IdentitiesWithoutRoom(job);
  return std::ranges::any_of(checks, [&](const TaskId& task) {
    const ResultCheck& check = *checks_.Find(task);
    return check.leased || AnyIdentityFits(job.spec, [&](const std::string& identity) {
             return check.MayBeDoneBy(identity) && !without_room.contains(identity);
           });
  });
}

}  // namespace sheaf::coordinator
