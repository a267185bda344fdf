// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/lease_failures.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/printable.h"
#include "coordinator/scheduling/frame_phases.h"
#include "coordinator/scheduling/loading_failures.h"
#include "coordinator/scheduling/set_aside.h"
#include "coordinator/scheduling/share_limits.h"

namespace sheaf::coordinator::scheduling {
namespace {

absl::Duration RetryDelay(const WorkState& state, int failure_count) {
  absl::Duration delay = state.limits.retry_delay_initial;
  for (int i = 1; i < failure_count && delay < state.limits.retry_delay_max; ++i) delay *= 2;
  return std::min(delay, state.limits.retry_delay_max);
}

// Neither the worker nor the task is at fault: the job waits until a worker has room, and the
// worker renders other jobs. Returns whether the refusal is new: leases of one load fail together.
bool RefuseForCache(WorkState& state, const Lease& lease, const LeaseFailure& failure,
                    SteadyTime now) {
  JobRecord& job = state.jobs.at(lease.frame.job_id);
  std::erase_if(job.cache_refusals, [&](const auto& refusal) {
    return state.workers.Find(refusal.first) == nullptr;  // It has been forgotten.
  });
  CacheRefusal& refusal = job.cache_refusals[lease.worker_id];
  if (refusal.count > 0 && now < refusal.not_before) return false;
  ++refusal.count;
  refusal.needed_bytes = failure.cache_needed_bytes;
  refusal.room_bytes = failure.cache_room_bytes;
  refusal.not_before = now + RetryDelay(state, refusal.count);
  return true;
}

void KeepFailure(WorkState& state, const Lease& lease, const LeaseFailure& failure) {
  if (failure.kind == FailureKind::kReleased) return;
  JobRecord& job = state.jobs.at(lease.frame.job_id);
  FailureLog& log = job.failures;
  ++log.count;
  log.last.push_back({lease.frame.frame_number, lease.tile_rect, lease.task.block, lease.worker_id,
                      failure.kind, failure.message, absl::InfinitePast(), lease.kind});
  if (log.last.size() > static_cast<size_t>(state.limits.failures_kept_max)) log.last.pop_front();
  state.news.failure_jobs.insert(lease.frame.job_id);
}

std::string Quote(const WorkState& state, const Lease& lease, const LeaseFailure& failure) {
  // The coordinator's own message, not a worker's.
  if (failure.kind == FailureKind::kLost || failure.kind == FailureKind::kLoading) {
    return failure.message;
  }
  return absl::StrCat("worker ", lease.worker_id,
                      " says: ", Printable(failure.message, state.limits.worker_text_shown_max));
}

// Whether the failures show a poisonous task that has not been set aside yet.
bool ShouldSetAside(const WorkState& state, const TaskFailures& record) {
  return record.IsPoison(state.limits) && record.trouble.set_aside.empty();
}

void SetAsidePoison(WorkState& state, FrameRecord* frame, const TaskId& id,
                    const TaskFailures& record) {
  ++state.counters.tasks_poisoned;
  SetAside(state, frame, id, TaskFailureText(*frame, record));
}

void CountTaskFailure(WorkState& state, const Lease& lease, const LeaseFailure& failure,
                      SteadyTime now) {
  FrameRecord& frame = Frame(state, lease.frame);
  if (frame.tasks == nullptr) return;
  TaskFailures& record = FailuresOf(&frame, lease);
  ++record.attempt_count;
  if (failure.kind == FailureKind::kReleased || failure.kind == FailureKind::kScene) return;
  if (failure.kind == FailureKind::kLoading) return CountLoadingLoss(state, lease);
  const TaskId id = MakeTaskId(lease.frame, lease.task);
  record.Add(lease.worker_id, lease.identity, failure.kind, Quote(state, lease, failure));
  NoteTrouble(state, id, record);
  if (failure.kind == FailureKind::kInfrastructure) {
    record.not_before = now + RetryDelay(state, record.CountOf(FailureKind::kInfrastructure));
  }
  if (!ShouldSetAside(state, record)) return;
  const std::string& profile = state.jobs.at(lease.frame.job_id).spec.numeric_profile;
  // The coordinator itself observed a loss.
  if (failure.kind != FailureKind::kLost && !AreBelieved(state, profile, record.Identities())) {
    state.doubts.tasks.insert(id);
    return;
  }
  SetAsidePoison(state, &frame, id, record);
}

void JudgeScene(WorkState& state, const FrameId& id) {
  FrameRecord& frame = Frame(state, id);
  if (frame.scene_failed_by.empty()) return;
  std::set<std::string> identities;
  for (const auto& [identity, message] : frame.scene_failed_by) identities.insert(identity);
  const JobSpec& spec = state.jobs.at(id.job_id).spec;
  // One report is enough if no worker is left to contradict it; results are a contradiction.
  const bool confirmed =
      static_cast<int>(identities.size()) >= state.limits.scene_failure_workers_max &&
      frame.sample_count_done == 0 && AreBelieved(state, spec.numeric_profile, identities);
  if (!confirmed && OtherIdentitiesLive(state, spec, identities)) return;
  EndJob(state, id.job_id, JobPhase::kFailed,
         SceneFailureText(id.frame_number, frame.scene_failed_by.rbegin()->second));
}

void RefuseFrame(WorkState& state, const Lease& lease, const LeaseFailure& failure) {
  FrameRecord& frame = Frame(state, lease.frame);
  if (frame.tasks == nullptr) return;
  if (failure.kind == FailureKind::kMemory)
    return RefuseForMemory(state, lease.frame, lease.worker_id);
  frame.refused_by[lease.worker_id] = failure.kind;
  frame.scene_failed_by[lease.identity] = Quote(state, lease, failure);
  state.doubts.frames.insert(lease.frame);
  JudgeScene(state, lease.frame);
}

void DropLeasesOf(WorkState& state, const WorkerRecord& worker) {
  const std::set<uint64_t> held = worker.leases;
  for (const uint64_t lease_id : held) DropLease(state, lease_id, /*put_back=*/true);
}

// Another identity rendered a task that the worker failed. After enough such jobs the worker is
// sick.
void NoteFailedJob(WorkState& state, WorkerRecord* worker, uint64_t job_id,
                   const std::string& words, SteadyTime now) {
  worker->failed_jobs[job_id] = now;
  std::erase_if(worker->failed_jobs,
                [&](const auto& failed) { return failed.second + state.limits.sick_window < now; });
  const auto job_count = static_cast<int>(worker->failed_jobs.size());
  if (job_count < state.limits.sick_jobs_min || worker->Sick()) return;
  state.workers.SetSick(
      worker,
      absl::StrCat("it is sick: within ", absl::FormatDuration(state.limits.sick_window),
                   " it failed tasks of ", job_count, " jobs that others rendered; last: ", words));
  ++state.counters.workers_sick;
  DropLeasesOf(state, *worker);
}

void BlameWorker(WorkState& state, const std::string& worker_id, const Lease& lease,
                 const LeaseFailure& failure, SteadyTime now) {
  WorkerRecord* worker = state.workers.Find(worker_id);
  if (worker == nullptr || failure.kind == FailureKind::kReleased ||
      failure.kind == FailureKind::kLost || failure.kind == FailureKind::kLoading) {
    return;
  }
  if (failure.kind == FailureKind::kInfrastructure) {
    if (now < worker->no_work_before) return;  // Leases that fail together have one cause.
    ++worker->infrastructure_failures;
    worker->no_work_before = now + RetryDelay(state, worker->infrastructure_failures);
    return;
  }
  if (lease.is_check) {  // Another worker has rendered it.
    NoteFailedJob(state, worker, lease.frame.job_id, Quote(state, lease, failure), now);
    return;
  }
  // The scene may be at fault, which is unknown until another worker renders the task.
  const auto record = Frame(state, lease.frame).failures.find(MakeTaskId(lease.frame, lease.task));
  if (record != Frame(state, lease.frame).failures.end()) {
    record->second.suspects[worker_id] = Quote(state, lease, failure);
  }
}

}  // namespace

// With fewer workers left, there may never be a second report of a broken scene.
void JudgeDoubtfulScenes(WorkState& state) {
  const std::set<FrameId> doubtful = state.doubts.frames;
  for (const FrameId& id : doubtful) JudgeScene(state, id);
}

void LoseLeases(WorkState& state, const std::string& worker_id, SteadyTime now) {
  const std::set<uint64_t> held = state.workers.Find(worker_id)->leases;
  std::set<FrameId> loading;  // Threads that wait for one scene lose one load.
  for (const uint64_t lease_id : held) {
    const Lease* lease = state.leases.Find(lease_id);
    if (lease == nullptr) continue;  // The loss of an earlier lease ended its job.
    ++state.counters.leases_expired;
    // Only a task being rendered or loaded can have killed the worker.
    FailureKind kind = FailureKind::kReleased;
    if (lease->phase == LeasePhase::kRendering) kind = FailureKind::kLost;
    if (lease->phase == LeasePhase::kLoading && loading.insert(lease->frame).second) {
      kind = FailureKind::kLoading;
    }
    Fail(state,
         {lease_id, kind,
          absl::StrCat("worker ", worker_id, " stopped responding",
                       kind == FailureKind::kLoading ? " while it loaded the scene" : "")},
         worker_id, now);
  }
}

void ApplyReport(WorkState& state, WorkerRecord* worker, const WorkerReport& report,
                 SteadyTime now) {
  for (const LeaseFailure& failure : report.failures) Fail(state, failure, report.worker_id, now);
  std::set<uint64_t> listed;
  for (const LeaseReport& held : report.leases) {
    if (!worker->leases.contains(held.lease_id)) continue;
    listed.insert(held.lease_id);
    state.leases.SetPhase(held.lease_id, held.phase);
    const bool is_running =
        held.phase == LeasePhase::kLoading || held.phase == LeasePhase::kRendering;
    if (is_running) state.sharing.order.Run(held.lease_id, now);
    if (held.phase == LeasePhase::kRendering) {
      const FrameId& frame = state.leases.Find(held.lease_id)->frame;
      state.jobs.at(frame.job_id).cache_refusals.erase(report.worker_id);
      NoteLoaded(state, frame);
    }
  }
  const std::set<uint64_t> leases = worker->leases;
  for (const uint64_t lease_id : leases) {
    const Lease* lease = state.leases.Find(lease_id);
    if (lease == nullptr) continue;
    if (report.draining && !listed.contains(lease_id)) {
      // Its grant never reached the worker, or the worker dropped it.
      Fail(state, {lease_id, FailureKind::kReleased, ""}, report.worker_id, now);
    } else if (lease->grant_time + state.limits.lease_age_max < now) {
      ++state.counters.leases_expired;
      Fail(state, {lease_id, FailureKind::kInternal, "the lease never ended: the renderer hangs"},
           report.worker_id, now);
    }
  }
  if (report.draining) JudgeDoubtfulScenes(state);
}

void DropLease(WorkState& state, uint64_t lease_id, bool put_back) {
  const Lease lease = *state.leases.Find(lease_id);
  const int holders_left = state.leases.Remove(lease_id);
  if (WorkerRecord* worker = state.workers.Find(lease.worker_id)) {
    worker->leases.erase(lease_id);
    state.sharing.order.End(lease_id, worker->last_seen_time);
  }
  state.sharing.held_threads.Remove(lease_id);
  if (lease.is_check) {
    if (put_back && holders_left == 0)
      state.checking.checks.Return(MakeTaskId(lease.frame, lease.task));
    return;
  }
  FrameRecord& frame = Frame(state, lease.frame);
  if (!put_back || holders_left > 0 || frame.tasks == nullptr) return;
  frame.tasks->PutBack(lease.task);
  const auto failures = frame.failures.find(MakeTaskId(lease.frame, lease.task));
  if (failures != frame.failures.end() && !failures->second.trouble.set_aside.empty()) {
    frame.tasks->SetAside(lease.task);
  }
  JobRecord& job = state.jobs.at(lease.frame.job_id);
  UpdateReady(state, &job, job.IndexOf(lease.frame.frame_number));
}

void Fail(WorkState& state, const LeaseFailure& failure, const std::string& worker_id,
          SteadyTime now) {
  const Lease* found = state.leases.Find(failure.lease_id);
  if (found == nullptr || found->worker_id != worker_id) return;
  const Lease lease = *found;
  const bool of_cache =
      failure.kind == FailureKind::kInfrastructure && failure.cache_needed_bytes > 0;
  if (of_cache && !RefuseForCache(state, lease, failure, now)) {
    return DropLease(state, failure.lease_id, /*put_back=*/true);
  }
  ++state.counters.failures[static_cast<size_t>(failure.kind)];
  DropLease(state, failure.lease_id, /*put_back=*/true);
  KeepFailure(state, lease, failure);
  if (of_cache) return;
  if (lease.is_check) {
    // The task is done: a worker's failure to repeat it does not concern the job.
    const bool failed = failure.kind != FailureKind::kReleased;
    if (failed) state.checking.checks.Avoid(MakeTaskId(lease.frame, lease.task), lease.identity);
    BlameWorker(state, worker_id, lease, failure, now);
    return;
  }
  CountTaskFailure(state, lease, failure, now);
  BlameWorker(state, worker_id, lease, failure, now);
  if (failure.kind == FailureKind::kScene || failure.kind == FailureKind::kMemory) {
    RefuseFrame(state, lease, failure);
  }
}

std::set<std::string> IdentitiesWithoutRoom(WorkState& state, const JobRecord& job) {
  std::set<std::string> identities;
  for (const auto& [id, refusal] : job.cache_refusals) {
    const WorkerRecord* refused = state.workers.Find(id);
    if (refused == nullptr) continue;
    const std::vector<WorkerRecord*> workers = state.workers.WorkersOf(refused->identity);
    const bool none_has_room = std::ranges::all_of(workers, [&](const WorkerRecord* worker) {
      return !worker->Live() || job.cache_refusals.contains(worker->worker_id);
    });
    if (none_has_room) identities.insert(refused->identity);
  }
  return identities;
}

void RestoreFailures(WorkState& state, uint64_t job_id, FailureLog failures) {
  JobRecord& job = state.jobs.at(job_id);
  job.failures = std::move(failures);
  RestoreLoadingLosses(state, &job);
}

std::set<uint64_t> TakeFailureJobs(WorkState& state, absl::Time stamp) {
  for (const uint64_t id : state.news.failure_jobs) {
    const auto job = state.jobs.find(id);
    if (job == state.jobs.end()) continue;
    for (FailureRecord& failure : job->second.failures.last) {
      if (failure.time == absl::InfinitePast()) failure.time = stamp;
    }
  }
  return std::exchange(state.news.failure_jobs, {});
}

bool OthersLive(const WorkState& state, const JobSpec& spec, const std::set<std::string>& failed) {
  int live_failed = 0;
  for (const std::string& id : failed) {
    const auto found = state.workers.workers().find(id);
    if (found == state.workers.workers().end()) continue;
    const WorkerRecord& worker = found->second;
    const bool is_of_job =
        worker.numeric_profile == spec.numeric_profile && Fits(spec.requirements, worker.traits);
    if (worker.Live() && is_of_job) ++live_failed;
  }
  return state.workers.kinds().LiveCount(spec.numeric_profile, spec.requirements) > live_failed;
}

bool OtherIdentitiesLive(const WorkState& state, const JobSpec& spec,
                         const std::set<std::string>& failed) {
  return AnyIdentityFits(state, spec,
                         [&](const std::string& identity) { return !failed.contains(identity); });
}

bool AreBelieved(const WorkState& state, const std::string& numeric_profile,
                 const std::set<std::string>& identities) {
  const auto has_results = [&state](const std::string& identity) {
    return state.workers.ResultCount(identity) > 0;
  };
  if (std::ranges::any_of(identities, has_results)) return true;
  return std::ranges::none_of(state.workers.LiveIdentities(numeric_profile),
                              [&](const auto& live) { return has_results(live.first); });
}

// Doubt ends when the last worker with results leaves, or when one that failed the task has some.
// All workers may have failed the task by then, so no further failure would trigger the check.
void JudgeDoubtfulTasks(WorkState& state) {
  for (const TaskId& id : std::exchange(state.doubts.tasks, {})) {
    const auto job = state.jobs.find(id.frame.job_id);
    if (job == state.jobs.end()) continue;
    const std::optional<uint32_t> index = job->second.FindIndex(id.frame.frame_number);
    if (!index) continue;
    FrameRecord& frame = job->second.frames[*index];
    const auto found = frame.failures.find(id);
    if (frame.tasks == nullptr || found == frame.failures.end()) continue;
    const TaskFailures& record = found->second;
    if (!ShouldSetAside(state, record)) continue;
    const JobSpec& spec = job->second.spec;
    if (state.workers.LiveCount(spec.numeric_profile) == 0 ||
        OthersLive(state, spec, record.Workers()) ||
        !AreBelieved(state, spec.numeric_profile, record.Identities())) {
      state.doubts.tasks.insert(id);
      continue;
    }
    SetAsidePoison(state, &frame, id, record);
  }
}

void BlameSuspects(WorkState& state, const std::map<std::string, std::string>& suspects,
                   uint64_t job_id, const std::string& rendered_by, SteadyTime now) {
  const WorkerRecord* renderer = state.workers.Find(rendered_by);
  for (const auto& [worker_id, words] : suspects) {
    WorkerRecord* worker = state.workers.Find(worker_id);
    if (worker == nullptr || worker_id == rendered_by) continue;
    if (renderer != nullptr && renderer->identity == worker->identity) continue;
    NoteFailedJob(state, worker, job_id, words, now);
  }
}

void Quarantine(WorkState& state, const std::string& identity, const std::string& reason,
                bool made_false_results) {
  const bool is_new = !state.workers.quarantined().contains(identity);
  if (is_new || made_false_results)
    state.news.quarantines.push_back({identity, reason, made_false_results});
  if (!is_new) return;
  state.workers.Quarantine(identity, reason);
  ++state.counters.workers_quarantined;
  for (const WorkerRecord* worker : state.workers.WorkersOf(identity)) DropLeasesOf(state, *worker);
}

void RestoreQuarantine(WorkState& state, const QuarantineRecord& record) {
  state.workers.Quarantine(record.identity, record.reason);
}

bool LiftQuarantine(WorkState& state, const std::string& identity) {
  bool was_excluded = state.workers.quarantined().contains(identity);
  state.workers.LiftQuarantine(identity);
  std::erase_if(state.news.quarantines,
                [&](const auto& record) { return record.identity == identity; });
  for (WorkerRecord* worker : state.workers.WorkersOf(identity)) {
    was_excluded |= worker->Sick();
    worker->failed_jobs.clear();
    state.workers.SetSick(worker, "");
  }
  return was_excluded;
}

std::vector<QuarantineRecord> TakeQuarantines(WorkState& state, absl::Time stamp) {
  for (QuarantineRecord& record : state.news.quarantines) record.time = stamp;
  return std::exchange(state.news.quarantines, {});
}

}  // namespace sheaf::coordinator::scheduling
