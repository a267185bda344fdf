// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that handles leases that end without a result.
#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/printable.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

bool Scheduler::Tick(SteadyTime now) {
  const std::vector<std::string> lost = workers_.MarkLost(now);
  for (const std::string& worker_id : lost) {
    ++counters_.workers_lost;
    LoseLeases(worker_id, now);
    NoteWarm(*workers_.Find(worker_id));
  }
  workers_.ForgetOld(now);  // Last: a worker that holds leases must stay known.
  if (!lost.empty()) JudgeDoubtfulScenes();
  JudgeDoubtfulTasks();
  const bool some_are_stuck = !stuck_frames_.empty();
  CloseStuckFrames();
  return !lost.empty() || some_are_stuck;
}

// With fewer workers left, there may never be a second report of a broken scene.
void Scheduler::JudgeDoubtfulScenes() {
  const std::set<FrameId> doubtful = doubtful_frames_;
  for (const FrameId& id : doubtful) JudgeScene(id);
}

void Scheduler::LoseLeases(const std::string& worker_id, SteadyTime now) {
  const std::set<uint64_t> held = workers_.Find(worker_id)->leases;
  std::set<FrameId> loading;  // Threads that wait for one scene lose one load.
  for (const uint64_t lease_id : held) {
    const Lease* lease = leases_.Find(lease_id);
    if (lease == nullptr) continue;  // The loss of an earlier lease ended its job.
    ++counters_.leases_expired;
    // Only a task being rendered or loaded can have killed the worker.
    FailureKind kind = FailureKind::kReleased;
    if (lease->phase == LeasePhase::kRendering) kind = FailureKind::kLost;
    if (lease->phase == LeasePhase::kLoading && loading.insert(lease->frame).second) {
      kind = FailureKind::kLoading;
    }
    Fail({lease_id, kind,
          absl::StrCat("worker ", worker_id, " stopped responding",
                       kind == FailureKind::kLoading ? " while it loaded the scene" : "")},
         worker_id, now);
  }
}

void Scheduler::ApplyReport(WorkerRecord* worker, const WorkerReport& report, SteadyTime now) {
  for (const LeaseFailure& failure : report.failures) Fail(failure, report.worker_id, now);
  std::set<uint64_t> listed;
  for (const LeaseReport& held : report.leases) {
    if (!worker->leases.contains(held.lease_id)) continue;
    listed.insert(held.lease_id);
    leases_.SetPhase(held.lease_id, held.phase);
    const bool is_running =
        held.phase == LeasePhase::kLoading || held.phase == LeasePhase::kRendering;
    if (is_running) shares_.Run(held.lease_id, now);
    if (held.phase == LeasePhase::kRendering) {
      const FrameId& frame = leases_.Find(held.lease_id)->frame;
      jobs_.at(frame.job_id).cache_refusals.erase(report.worker_id);
      NoteLoaded(frame);
    }
  }
  const std::set<uint64_t> leases = worker->leases;
  for (const uint64_t lease_id : leases) {
    const Lease* lease = leases_.Find(lease_id);
    if (lease == nullptr) continue;
    if (report.draining && !listed.contains(lease_id)) {
      // Its grant never reached the worker, or the worker dropped it.
      Fail({lease_id, FailureKind::kReleased, ""}, report.worker_id, now);
    } else if (lease->grant_time + limits_.lease_age_max < now) {
      ++counters_.leases_expired;
      Fail({lease_id, FailureKind::kInternal, "the lease never ended: the renderer hangs"},
           report.worker_id, now);
    }
  }
  if (report.draining) JudgeDoubtfulScenes();
}

void Scheduler::DropLease(uint64_t lease_id, bool put_back) {
  const Lease lease = *leases_.Find(lease_id);
  const int holders_left = leases_.Remove(lease_id);
  if (WorkerRecord* worker = workers_.Find(lease.worker_id)) {
    worker->leases.erase(lease_id);
    shares_.End(lease_id, worker->last_seen_time);
  }
  held_threads_.Remove(lease_id);
  if (lease.is_check) {
    if (put_back && holders_left == 0) checks_.Return(MakeTaskId(lease.frame, lease.task));
    return;
  }
  FrameRecord& frame = Frame(lease.frame);
  if (!put_back || holders_left > 0 || frame.tasks == nullptr) return;
  frame.tasks->PutBack(lease.task);
  const auto failures = frame.failures.find(MakeTaskId(lease.frame, lease.task));
  if (failures != frame.failures.end() && !failures->second.trouble.set_aside.empty()) {
    frame.tasks->SetAside(lease.task);
  }
  JobRecord& job = jobs_.at(lease.frame.job_id);
  UpdateReady(&job, job.IndexOf(lease.frame.frame_number));
}

void Scheduler::Fail(const LeaseFailure& failure, const std::string& worker_id, SteadyTime now) {
  const Lease* found = leases_.Find(failure.lease_id);
  if (found == nullptr || found->worker_id != worker_id) return;
  const Lease lease = *found;
  const bool of_cache =
      failure.kind == FailureKind::kInfrastructure && failure.cache_needed_bytes > 0;
  if (of_cache && !RefuseForCache(lease, failure, now)) {
    return DropLease(failure.lease_id, /*put_back=*/true);
  }
  ++counters_.failures[static_cast<size_t>(failure.kind)];
  DropLease(failure.lease_id, /*put_back=*/true);
  KeepFailure(lease, failure);
  if (of_cache) return;
  if (lease.is_check) {
    // The task is done: a worker's failure to repeat it does not concern the job.
    const bool failed = failure.kind != FailureKind::kReleased;
    if (failed) checks_.Avoid(MakeTaskId(lease.frame, lease.task), lease.identity);
    BlameWorker(worker_id, lease, failure, now);
    return;
  }
  CountTaskFailure(lease, failure, now);
  BlameWorker(worker_id, lease, failure, now);
  if (failure.kind == FailureKind::kScene || failure.kind == FailureKind::kMemory) {
    RefuseFrame(lease, failure);
  }
}

// Neither the worker nor the task is at fault: the job waits until a worker has room, and the
// worker renders other jobs. Returns whether the refusal is new: leases of one load fail together.
bool Scheduler::RefuseForCache(const Lease& lease, const LeaseFailure& failure, SteadyTime now) {
  JobRecord& job = jobs_.at(lease.frame.job_id);
  std::erase_if(job.cache_refusals, [&](const auto& refusal) {
    return workers_.Find(refusal.first) == nullptr;  // It has been forgotten.
  });
  CacheRefusal& refusal = job.cache_refusals[lease.worker_id];
  if (refusal.count > 0 && now < refusal.not_before) return false;
  ++refusal.count;
  refusal.needed_bytes = failure.cache_needed_bytes;
  refusal.room_bytes = failure.cache_room_bytes;
  refusal.not_before = now + RetryDelay(refusal.count);
  return true;
}

std::set<std::string> Scheduler::IdentitiesWithoutRoom(const JobRecord& job) {
  std::set<std::string> identities;
  for (const auto& [id, refusal] : job.cache_refusals) {
    const WorkerRecord* refused = workers_.Find(id);
    if (refused == nullptr) continue;
    const std::vector<WorkerRecord*> workers = workers_.WorkersOf(refused->identity);
    const bool none_has_room = std::ranges::all_of(workers, [&](const WorkerRecord* worker) {
      return !worker->Live() || job.cache_refusals.contains(worker->worker_id);
    });
    if (none_has_room) identities.insert(refused->identity);
  }
  return identities;
}

void Scheduler::KeepFailure(const Lease& lease, const LeaseFailure& failure) {
  if (failure.kind == FailureKind::kReleased) return;
  JobRecord& job = jobs_.at(lease.frame.job_id);
  FailureLog& log = job.failures;
  ++log.count;
  log.last.push_back({lease.frame.frame_number, lease.tile_rect, lease.task.block, lease.worker_id,
                      failure.kind, failure.message, absl::InfinitePast(), lease.kind});
  if (log.last.size() > static_cast<size_t>(limits_.failures_kept_max)) log.last.pop_front();
  failure_jobs_.insert(lease.frame.job_id);
}

void Scheduler::RestoreFailures(uint64_t job_id, FailureLog failures) {
  JobRecord& job = jobs_.at(job_id);
  job.failures = std::move(failures);
  RestoreLoadingLosses(&job);
}

std::set<uint64_t> Scheduler::TakeFailureJobs(absl::Time stamp) {
  for (const uint64_t id : failure_jobs_) {
    const auto job = jobs_.find(id);
    if (job == jobs_.end()) continue;
    for (FailureRecord& failure : job->second.failures.last) {
      if (failure.time == absl::InfinitePast()) failure.time = stamp;
    }
  }
  return std::exchange(failure_jobs_, {});
}

absl::Duration Scheduler::RetryDelay(int failure_count) const {
  absl::Duration delay = limits_.retry_delay_initial;
  for (int i = 1; i < failure_count && delay < limits_.retry_delay_max; ++i) delay *= 2;
  return std::min(delay, limits_.retry_delay_max);
}

bool Scheduler::OthersLive(const JobSpec& spec, const std::set<std::string>& failed) const {
  int live_failed = 0;
  for (const std::string& id : failed) {
    const auto found = workers_.workers().find(id);
    if (found == workers_.workers().end()) continue;
    const WorkerRecord& worker = found->second;
    const bool is_of_job =
        worker.numeric_profile == spec.numeric_profile && Fits(spec.requirements, worker.traits);
    if (worker.Live() && is_of_job) ++live_failed;
  }
  return workers_.kinds().LiveCount(spec.numeric_profile, spec.requirements) > live_failed;
}

bool Scheduler::OtherIdentitiesLive(const JobSpec& spec,
                                    const std::set<std::string>& failed) const {
  return AnyIdentityFits(spec,
                         [&](const std::string& identity) { return !failed.contains(identity); });
}

bool Scheduler::AreBelieved(const std::string& numeric_profile,
                            const std::set<std::string>& identities) const {
  const auto has_results = [this](const std::string& identity) {
    return workers_.ResultCount(identity) > 0;
  };
  if (std::ranges::any_of(identities, has_results)) return true;
  return std::ranges::none_of(workers_.LiveIdentities(numeric_profile),
                              [&](const auto& live) { return has_results(live.first); });
}

std::string Scheduler::Quote(const Lease& lease, const LeaseFailure& failure) const {
  // The coordinator's own message, not a worker's.
  if (failure.kind == FailureKind::kLost || failure.kind == FailureKind::kLoading) {
    return failure.message;
  }
  return absl::StrCat("worker ", lease.worker_id,
                      " says: ", Printable(failure.message, limits_.worker_text_shown_max));
}

void Scheduler::CountTaskFailure(const Lease& lease, const LeaseFailure& failure, SteadyTime now) {
  FrameRecord& frame = Frame(lease.frame);
  if (frame.tasks == nullptr) return;
  TaskFailures& record = FailuresOf(&frame, lease);
  ++record.attempt_count;
  if (failure.kind == FailureKind::kReleased || failure.kind == FailureKind::kScene) return;
  if (failure.kind == FailureKind::kLoading) return CountLoadingLoss(lease);
  const TaskId id = MakeTaskId(lease.frame, lease.task);
  record.Add(lease.worker_id, lease.identity, failure.kind, Quote(lease, failure));
  NoteTrouble(id, record);
  if (failure.kind == FailureKind::kInfrastructure) {
    record.not_before = now + RetryDelay(record.CountOf(FailureKind::kInfrastructure));
  }
  if (!record.IsPoison(limits_) || !record.trouble.set_aside.empty()) return;
  const std::string& profile = jobs_.at(lease.frame.job_id).spec.numeric_profile;
  // The coordinator itself observed a loss.
  if (failure.kind != FailureKind::kLost && !AreBelieved(profile, record.Identities())) {
    doubtful_tasks_.insert(id);
    return;
  }
  ++counters_.tasks_poisoned;
  SetAside(&frame, id, TaskFailureText(frame, record));
}

// Doubt ends when the last worker with results leaves, or when one that failed the task has some.
// All workers may have failed the task by then, so no further failure would trigger the check.
void Scheduler::JudgeDoubtfulTasks() {
  for (const TaskId& id : std::exchange(doubtful_tasks_, {})) {
    const auto job = jobs_.find(id.frame.job_id);
    if (job == jobs_.end()) continue;
    const std::optional<uint32_t> index = job->second.FindIndex(id.frame.frame_number);
    if (!index) continue;
    FrameRecord& frame = job->second.frames[*index];
    const auto found = frame.failures.find(id);
    if (frame.tasks == nullptr || found == frame.failures.end()) continue;
    const TaskFailures& record = found->second;
    if (!record.IsPoison(limits_) || !record.trouble.set_aside.empty()) continue;
    const JobSpec& spec = job->second.spec;
    if (workers_.LiveCount(spec.numeric_profile) == 0 || OthersLive(spec, record.Workers()) ||
        !AreBelieved(spec.numeric_profile, record.Identities())) {
      doubtful_tasks_.insert(id);
      continue;
    }
    ++counters_.tasks_poisoned;
    SetAside(&frame, id, TaskFailureText(frame, record));
  }
}

void Scheduler::RefuseFrame(const Lease& lease, const LeaseFailure& failure) {
  FrameRecord& frame = Frame(lease.frame);
  if (frame.tasks == nullptr) return;
  if (failure.kind == FailureKind::kMemory) return RefuseForMemory(lease.frame, lease.worker_id);
  frame.refused_by[lease.worker_id] = failure.kind;
  frame.scene_failed_by[lease.identity] = Quote(lease, failure);
  doubtful_frames_.insert(lease.frame);
  JudgeScene(lease.frame);
}

void Scheduler::JudgeScene(const FrameId& id) {
  FrameRecord& frame = Frame(id);
  if (frame.scene_failed_by.empty()) return;
  std::set<std::string> identities;
  for (const auto& [identity, message] : frame.scene_failed_by) identities.insert(identity);
  const JobSpec& spec = jobs_.at(id.job_id).spec;
  // One report is enough if no worker is left to contradict it; results are a contradiction.
  const bool confirmed = static_cast<int>(identities.size()) >= limits_.scene_failure_workers_max &&
                         frame.sample_count_done == 0 &&
                         AreBelieved(spec.numeric_profile, identities);
  if (!confirmed && OtherIdentitiesLive(spec, identities)) return;
  EndJob(id.job_id, JobPhase::kFailed,
         SceneFailureText(id.frame_number, frame.scene_failed_by.rbegin()->second));
}

void Scheduler::BlameWorker(const std::string& worker_id, const Lease& lease,
                            const LeaseFailure& failure, SteadyTime now) {
  WorkerRecord* worker = workers_.Find(worker_id);
  if (worker == nullptr || failure.kind == FailureKind::kReleased ||
      failure.kind == FailureKind::kLost || failure.kind == FailureKind::kLoading) {
    return;
  }
  if (failure.kind == FailureKind::kInfrastructure) {
    if (now < worker->no_work_before) return;  // Leases that fail together have one cause.
    ++worker->infrastructure_failures;
    worker->no_work_before = now + RetryDelay(worker->infrastructure_failures);
    return;
  }
  if (lease.is_check) {  // Another worker has rendered it.
    NoteFailedJob(worker, lease.frame.job_id, Quote(lease, failure), now);
    return;
  }
  // The scene may be at fault, which is unknown until another worker renders the task.
  const auto record = Frame(lease.frame).failures.find(MakeTaskId(lease.frame, lease.task));
  if (record != Frame(lease.frame).failures.end()) {
    record->second.suspects[worker_id] = Quote(lease, failure);
  }
}

void Scheduler::BlameSuspects(const std::map<std::string, std::string>& suspects, uint64_t job_id,
                              const std::string& rendered_by, SteadyTime now) {
  const WorkerRecord* renderer = workers_.Find(rendered_by);
  for (const auto& [worker_id, words] : suspects) {
    WorkerRecord* worker = workers_.Find(worker_id);
    if (worker == nullptr || worker_id == rendered_by) continue;
    if (renderer != nullptr && renderer->identity == worker->identity) continue;
    NoteFailedJob(worker, job_id, words, now);
  }
}

void Scheduler::NoteFailedJob(WorkerRecord* worker, uint64_t job_id, const std::string& words,
                              SteadyTime now) {
  worker->failed_jobs[job_id] = now;
  std::erase_if(worker->failed_jobs,
                [&](const auto& failed) { return failed.second + limits_.sick_window < now; });
  const auto job_count = static_cast<int>(worker->failed_jobs.size());
  if (job_count < limits_.sick_jobs_min || worker->Sick()) return;
  workers_.SetSick(
      worker,
      absl::StrCat("it is sick: within ", absl::FormatDuration(limits_.sick_window),
                   " it failed tasks of ", job_count, " jobs that others rendered; last: ", words));
  ++counters_.workers_sick;
  DropLeasesOf(*worker);
}

void Scheduler::DropLeasesOf(const WorkerRecord& worker) {
  const std::set<uint64_t> held = worker.leases;
  for (const uint64_t lease_id : held) DropLease(lease_id, /*put_back=*/true);
}

void Scheduler::Quarantine(const std::string& identity, const std::string& reason,
                           bool made_false_results) {
  const bool is_new = !workers_.quarantined().contains(identity);
  if (is_new || made_false_results) quarantines_.push_back({identity, reason, made_false_results});
  if (!is_new) return;
  workers_.Quarantine(identity, reason);
  ++counters_.workers_quarantined;
  for (const WorkerRecord* worker : workers_.WorkersOf(identity)) DropLeasesOf(*worker);
}

void Scheduler::RestoreQuarantine(const QuarantineRecord& record) {
  workers_.Quarantine(record.identity, record.reason);
}

bool Scheduler::LiftQuarantine(const std::string& identity) {
  bool was_excluded = workers_.quarantined().contains(identity);
  workers_.LiftQuarantine(identity);
  std::erase_if(quarantines_, [&](const auto& record) { return record.identity == identity; });
  for (WorkerRecord* worker : workers_.WorkersOf(identity)) {
    was_excluded |= worker->Sick();
    worker->failed_jobs.clear();
    workers_.SetSick(worker, "");
  }
  return was_excluded;
}

std::vector<QuarantineRecord> Scheduler::TakeQuarantines(absl::Time stamp) {
  for (QuarantineRecord& record : quarantines_) record.time = stamp;
  return std::exchange(quarantines_, {});
}

}  // namespace sheaf::coordinator
