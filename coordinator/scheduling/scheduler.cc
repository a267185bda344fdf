// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/scheduler.h"

#include <algorithm>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "coordinator/core/job/job_approval.h"
#include "coordinator/core/job/job_check.h"
#include "coordinator/scheduling/check_leases.h"
#include "coordinator/scheduling/frame_phases.h"
#include "coordinator/scheduling/lease_failures.h"
#include "coordinator/scheduling/lease_grants.h"
#include "coordinator/scheduling/loading_failures.h"
#include "coordinator/scheduling/placed_grants.h"
#include "coordinator/scheduling/set_aside.h"
#include "coordinator/scheduling/share_limits.h"
#include "coordinator/scheduling/work_holds.h"

namespace sheaf::coordinator {
namespace {

void GrowTasks(std::span<const uint64_t> samples, FrameTasks* tasks) {
  SHEAF_CHECK(samples.size() == tasks->grid().cells().size());
  for (uint32_t cell = 0; cell < samples.size(); ++cell) tasks->Grow(cell, samples[cell]);
}

}  // namespace

Scheduler::Scheduler(const Limits& limits, uint64_t first_lease_id)
    : state_(limits, first_lease_id) {}

absl::Status Scheduler::CheckJob(const JobSpec& spec) const {
  if (state_.live_job_count >= state_.limits.live_jobs_max) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "there are ", state_.live_job_count, " unfinished jobs, the limit; try again later"));
  }
  if (absl::Status status = CheckPriority(spec.priority); !status.ok()) return status;
  if (!state_.sharing.groups.HasRoom(spec.requirements, state_.limits.requirement_groups_max)) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "the unfinished jobs have ", state_.limits.requirement_groups_max,
        " different requirements of workers, the limit; use a pool or tags that others use, or "
        "try again later"));
  }
  if (absl::Status status = scheduling::CheckDependencies(state_, spec); !status.ok())
    return status;
  if (spec.approvals.empty()) return CheckJobSpec(spec, state_.limits);
  JobSpec approved = spec;
  approved.frames = ApprovedFrames(spec);
  return CheckJobSpec(approved, state_.limits);
}

absl::Status Scheduler::CheckOwner(const JobSpec& spec) {
  if (spec.owner == kLocalOwner) return absl::OkStatus();
  const auto found = state_.owner_work.find(spec.owner);
  const OwnerWork present = found == state_.owner_work.end() ? OwnerWork() : found->second;
  absl::Status allowed = CheckOwnerWork(present, WorkOf(spec), state_.limits);
  if (!allowed.ok()) ++state_.counters.jobs_refused;
  return allowed;
}

void Scheduler::AddJob(const JobSpec& spec) {
  const auto [it, is_new] = state_.jobs.emplace(spec.job_id, JobRecord{});
  SHEAF_CHECK(is_new);
  JobRecord& job = it->second;
  job.spec = {.job_id = spec.job_id,
              .pilot = spec.pilot,
              .title = spec.title,
              .owner = spec.owner,
              .show = spec.show,
              .requirements = spec.requirements,
              .priority = spec.priority,
              .partition = spec.partition,
              .numeric_profile = spec.numeric_profile,
              .frames = {},
              .effect_costs = spec.effect_costs,
              .dependencies = spec.dependencies,
              .approvals = spec.approvals,
              .deadline = spec.deadline,
              .command = spec.command};
  job.frames.resize(spec.frames.size());
  for (size_t i = 0; i < spec.frames.size(); ++i) {
    const PackedFrame& frame = job.frames[i].packed = PackedFrame(spec.frames[i], &job.shapes);
    state_.live_frames.Insert(frame.frame_digest(), {spec.job_id, frame.frame_number()});
  }
  job.pending = PendingFrames(static_cast<uint32_t>(job.frames.size()),
                              [&frames = job.frames](uint32_t i) -> const PackedDigest& {
                                return frames[i].packed.scene();
                              });
  job.requirement_group = state_.sharing.groups.Add(spec.requirements);
  state_.sharing.order.AddJob({spec.job_id, spec.numeric_profile, spec.priority, spec.show,
                               spec.owner, job.requirement_group});
  for (const uint32_t index : job.pending.FirstOfScenes(state_.limits.placement_scenes_max)) {
    scheduling::NoteWork(state_, &job, job.frames[index].packed.scene());
  }
  scheduling::UpdateReadyJob(state_, &job);
  ++state_.live_job_count;
  job.work = WorkOf(spec);
  state_.owner_work[spec.owner] += job.work;
  state_.dependents.Add(spec);
  scheduling::JudgeDependencies(state_, &job);
  scheduling::JudgeDependents(state_, spec.job_id);  // It may have existed before, as an ended job.
}

void Scheduler::RemoveJob(uint64_t job_id) {
  SHEAF_CHECK(state_.jobs.at(job_id).phase != JobPhase::kLive);
  state_.jobs.erase(job_id);
}

void Scheduler::RestoreEnded(uint64_t job_id, JobPhase phase, const std::string& failure) {
  scheduling::EndJob(state_, job_id, phase, failure);
  std::erase(state_.news.ended_jobs, job_id);
}

void Scheduler::RestoreDelivered(const FrameId& id, const ResultCost& cost, uint64_t sample_count) {
  JobRecord& job = state_.jobs.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  FrameRecord& frame = job.frames[index];
  frame.sample_count_done = frame.sample_count_timed = sample_count;
  frame.cost = cost;
  ++job.delivered_count;
  scheduling::Close(state_, &job, index, FrameRecord::Phase::kDelivered);
}

void Scheduler::RestoreRound(const FrameId& id, std::span<const uint64_t> samples) {
  JobRecord& job = state_.jobs.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  if (job.frames[index].phase == FrameRecord::Phase::kPending)
    scheduling::Open(state_, &job, index);
  FrameTasks* tasks = job.frames[index].tasks.get();
  std::vector<uint64_t> grown = tasks->SamplesOfCells();
  SHEAF_CHECK(samples.size() == grown.size());
  for (size_t i = 0; i < grown.size(); ++i) grown[i] = std::max(grown[i], samples[i]);
  GrowTasks(grown, tasks);
  scheduling::UpdateReady(state_, &job, index);
}

FrameTasks::Fit Scheduler::RestorePart(const FrameId& id, const PixelRect& tile, SampleBlock block,
                                       const TileCells& cells, const ResultCost& cost,
                                       TaskKind kind) {
  JobRecord& job = state_.jobs.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  FrameRecord& frame = job.frames[index];
  if (frame.phase == FrameRecord::Phase::kPending) scheduling::Open(state_, &job, index);
  const std::optional<Task> task_there = frame.tasks->Find(tile, block, cells, kind);
  if (!task_there) return FrameTasks::Fit::kPartial;
  const Task& task = *task_there;
  const FrameTasks::Fit fit = frame.tasks->FitOf(task);
  if (fit != FrameTasks::Fit::kWanted) return fit;
  frame.tasks->Accept(task, cost.cpu_duration);
  scheduling::NoteLoaded(state_, id);
  frame.sample_count_done = frame.tasks->sample_count_done();
  if (cost.cpu_duration > absl::ZeroDuration()) {
    frame.sample_count_timed += frame.tasks->PixelSamples(task);
  }
  frame.cost.Add(cost);
  state_.sharing.order.NoteCost(id.job_id, frame.tasks->PixelSamples(task), cost.cpu_duration);
  if (frame.tasks->Complete()) frame.phase = FrameRecord::Phase::kRendered;
  scheduling::UpdateReady(state_, &job, index);
  return fit;
}

Scheduler::FoundTask Scheduler::FindTask(const std::string& frame_digest, const PixelRect& tile,
                                         SampleBlock block, const TileCells& cells,
                                         uint64_t lease_id, TaskKind kind,
                                         const std::string& field) {
  const PackedDigest digest(frame_digest);
  std::vector<FrameId> candidates = state_.live_frames.Find(digest);
  // Leased tasks come first.
  if (const Lease* lease = state_.leases.Find(lease_id)) {
    candidates.insert(candidates.begin(), lease->frame);
  }
  FoundTask best;
  for (const FrameId& id : candidates) {
    JobRecord& job = state_.jobs.at(id.job_id);
    const uint32_t index = job.IndexOf(id.frame_number);
    FrameRecord& frame = job.frames[index];
    if (frame.packed.frame_digest() != digest) continue;
    if (frame.phase == FrameRecord::Phase::kPending) {
      if (!scheduling::MayOpen(state_, frame)) continue;
      scheduling::Open(state_, &job, index);
    }
    if (frame.tasks == nullptr) continue;
    const std::optional<Task> task = frame.tasks->Find(tile, block, cells, kind);
    FoundTask found{FoundTask::Kind::kMalformed, id, task.value_or(Task{0, block})};
    const bool fits_field = kind == TaskKind::kTraining || field == frame.tasks->field().sha256_hex;
    if (task && !fits_field) {
      found.kind = FoundTask::Kind::kOtherField;
    } else if (task) {
      switch (frame.tasks->FitOf(found.task)) {
        case FrameTasks::Fit::kWanted:
          found.kind = FoundTask::Kind::kWanted;
          return found;
        case FrameTasks::Fit::kCovered:
          found.kind = FoundTask::Kind::kCovered;
          break;
        case FrameTasks::Fit::kPartial:
          found.kind = FoundTask::Kind::kPartial;
          break;
        case FrameTasks::Fit::kOutside:
          break;
      }
    }
    const bool is_none = best.kind == FoundTask::Kind::kUnknown ||
                         best.kind == FoundTask::Kind::kMalformed ||
                         best.kind == FoundTask::Kind::kOtherField;
    if (is_none) best = found;
  }
  return best;
}

bool Scheduler::Accept(const FrameId& id, const Task& task, uint64_t lease_id,
                       const std::string& worker_id, const ResultCost& cost, SteadyTime now) {
  JobRecord& job = state_.jobs.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  FrameRecord& frame = job.frames[index];
  const Lease* lease = state_.leases.Find(lease_id);
  if (lease == nullptr) ++state_.counters.results_late;
  const SteadyTime grant_time = lease == nullptr ? SteadyTime::InfiniteFuture() : lease->grant_time;
  if (lease != nullptr && lease->frame == id && lease->task == task) {
    scheduling::ChargeResult(state_, *lease, cost, now);
  }
  std::map<std::string, std::string> suspects;
  const auto forget_failures = [&](const TaskId& rendered) {
    const auto failures = frame.failures.find(rendered);
    if (failures == frame.failures.end()) return;
    suspects.merge(failures->second.suspects);
    scheduling::ForgetTrouble(state_, &frame, rendered);
  };
  for (const Task& aside : frame.tasks->AsideOverlapping(task)) {
    forget_failures(MakeTaskId(id, aside));
  }
  for (const Task& covered : frame.tasks->Accept(task, cost.cpu_duration)) {
    for (const uint64_t holder : state_.leases.HoldersOf(MakeTaskId(id, covered))) {
      if (holder != lease_id) ++state_.counters.leases_cancelled;
      scheduling::DropLease(state_, holder, /*put_back=*/false);
    }
    forget_failures(MakeTaskId(id, covered));
  }
  forget_failures(MakeTaskId(id, task));
  scheduling::NoteLoaded(state_, id);
  const uint64_t samples = frame.tasks->PixelSamples(task);
  scheduling::NoteSpeed(state_, frame, worker_id, samples, cost);
  frame.sample_count_done += samples;
  frame.sample_count_timed += samples;
  frame.cost.Add(cost);
  state_.sharing.order.NoteCost(id.job_id, samples, cost.cpu_duration);
  ++state_.counters.results_accepted;
  state_.counters.samples_accepted += samples;
  state_.counters.rays_accepted += cost.ray_count;
  state_.counters.nonfinite_samples += cost.nonfinite_count;
  scheduling::NoteDelivery(state_, worker_id, samples, cost, grant_time, now);
  if (frame.tasks->Complete()) frame.phase = FrameRecord::Phase::kRendered;
  scheduling::UpdateReady(state_, &job, index);
  scheduling::BlameSuspects(state_, suspects, id.job_id, worker_id, now);
  return frame.phase == FrameRecord::Phase::kRendered;
}

void Scheduler::Revoke(const FrameId& id, const Task& task) {
  JobRecord& job = state_.jobs.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  FrameRecord& frame = job.frames[index];
  if (frame.tasks == nullptr) return;
  scheduling::DropCheckLeases(state_, MakeTaskId(id, task));
  state_.checking.checks.Erase(MakeTaskId(id, task));
  frame.tasks->Revoke(task);
  // A rendered frame needs no field.
  if (!frame.tasks->Complete()) frame.phase = FrameRecord::Phase::kOpen;
  frame.sample_count_done = frame.tasks->sample_count_done();
  ++state_.counters.parts_revoked;
  scheduling::UpdateReady(state_, &job, index);
}

void Scheduler::Grow(const FrameId& id, std::span<const uint64_t> samples) {
  JobRecord& job = state_.jobs.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  FrameRecord& frame = job.frames[index];
  SHEAF_CHECK(frame.phase == FrameRecord::Phase::kRendered);
  GrowTasks(samples, frame.tasks.get());
  if (!frame.tasks->Complete()) frame.phase = FrameRecord::Phase::kOpen;
  if (const auto wait = state_.checking.waits.find(id);
      wait != state_.checking.waits.end() && wait->second.waits) {
    state_.checking.waits.erase(wait);
  }
  scheduling::UpdateReady(state_, &job, index);
}

bool Scheduler::Deliver(const FrameId& id) {
  JobRecord& job = state_.jobs.at(id.job_id);
  SHEAF_CHECK(scheduling::Frame(state_, id).phase == FrameRecord::Phase::kRendered);
  scheduling::Close(state_, &job, job.IndexOf(id.frame_number), FrameRecord::Phase::kDelivered);
  ++state_.counters.frames_delivered;
  ++job.delivered_count;
  scheduling::JudgeIncompleteJob(state_, &job);
  const int32_t done_count = job.delivered_count - job.unapproved_count;
  if (done_count < static_cast<int32_t>(job.frames.size())) return false;
  scheduling::EndJob(state_, id.job_id, JobPhase::kSucceeded, "");
  return true;
}

std::vector<uint64_t> Scheduler::TakeEndedJobs() {
  return std::exchange(state_.news.ended_jobs, {});
}

void Scheduler::Pause(uint64_t job_id, SteadyTime now) {
  JobRecord& job = state_.jobs.at(job_id);
  if (job.phase != JobPhase::kLive || job.Paused()) return;
  job.paused_time = now;
  scheduling::UpdateReadyJob(state_, &job);
}

void Scheduler::Resume(uint64_t job_id, SteadyTime now) {
  JobRecord& job = state_.jobs.at(job_id);
  if (job.phase != JobPhase::kLive || !job.Paused()) return;
  const absl::Duration pause = std::max(absl::ZeroDuration(), now - job.paused_time);
  for (FrameRecord& frame : job.frames) frame.first_lease_time += pause;
  job.paused_time = SteadyTime::InfiniteFuture();
  scheduling::UpdateReadyJob(state_, &job);
}

absl::Status Scheduler::CheckPriority(int32_t priority) const {
  // Does not use the magnitude: the smallest integer has none.
  if (priority >= -state_.limits.priority_magnitude_max &&
      priority <= state_.limits.priority_magnitude_max) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("priority ", priority, " is outside +-", state_.limits.priority_magnitude_max));
}

void Scheduler::SetPriority(uint64_t job_id, int32_t priority) {
  JobRecord& job = state_.jobs.at(job_id);
  if (job.spec.priority == priority) return;
  job.spec.priority = priority;
  if (job.phase == JobPhase::kLive) state_.sharing.order.SetPriority(job_id, priority);
}

void Scheduler::RestoreField(const FrameId& id, const BlobDigest& field) {
  JobRecord& job = state_.jobs.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  if (job.frames[index].phase == FrameRecord::Phase::kPending)
    scheduling::Open(state_, &job, index);
  job.frames[index].tasks->SetField(field);
}

void Scheduler::SetField(const FrameId& id, const BlobDigest& field) {
  scheduling::Frame(state_, id).tasks->SetField(field);
  ++state_.counters.fields_trained;
}

absl::StatusOr<Scheduler::SynchronizeAnswer> Scheduler::Synchronize(const WorkerReport& report,
                                                                    SteadyTime now) {
  ++state_.counters.synchronize_calls;
  Tick(now);
  const WorkerRecord* known = state_.workers.Find(report.worker_id);
  if (known != nullptr && known->identity != IdentityOf(report)) {
    return absl::PermissionDeniedError(absl::StrCat("the worker id ", report.worker_id,
                                                    " belongs to another certificate; start ",
                                                    "the worker again to get a new one"));
  }
  WorkerRecord* worker = state_.workers.Touch(report, now);
  if (worker == nullptr) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the farm has ", state_.limits.workers_max, " workers, the limit"));
  }
  scheduling::ApplyReport(state_, worker, report, now);
  scheduling::CloseStuckFrames(state_);
  if (worker->Quarantined()) {
    scheduling::NoteWarm(state_, *worker);
    return absl::PermissionDeniedError(
        absl::StrCat("worker ", report.worker_id, " is quarantined: ", worker->quarantine_reason));
  }
  for (const uint64_t id : worker->leases) {
    worker->warm_scenes.insert(
        scheduling::Frame(state_, state_.leases.Find(id)->frame).packed.scene().Hex());
  }
  const size_t wanted = worker->Sick() ? 0 : scheduling::LeasesWanted(state_, *worker);
  if (!worker->Draining() && now >= worker->no_work_before) {
    while (worker->leases.size() < wanted && scheduling::MayHoldMore(state_, *worker) &&
           scheduling::Grant(state_, worker, now)) {
    }
    if (worker->leases.empty() && wanted > 0 && scheduling::MayHoldMore(state_, *worker))
      scheduling::Hedge(state_, worker, now);
  }
  SynchronizeAnswer answer;
  for (const uint64_t id : worker->leases) answer.leases.push_back(*state_.leases.Find(id));
  scheduling::NoteWarm(state_, *worker);
  answer.next_synchronize = scheduling::NextSynchronize(state_, *worker, now);
  answer.exits = worker->drained_then_exit && worker->leases.empty();
  return answer;
}

bool Scheduler::Tick(SteadyTime now) {
  const std::vector<std::string> lost = state_.workers.MarkLost(now);
  for (const std::string& worker_id : lost) {
    ++state_.counters.workers_lost;
    scheduling::LoseLeases(state_, worker_id, now);
    scheduling::NoteWarm(state_, *state_.workers.Find(worker_id));
  }
  state_.workers.ForgetOld(now);  // Last: a worker that holds leases must stay known.
  if (!lost.empty()) scheduling::JudgeDoubtfulScenes(state_);
  scheduling::JudgeDoubtfulTasks(state_);
  const bool some_are_stuck = !state_.doubts.stuck_frames.empty();
  scheduling::CloseStuckFrames(state_);
  return !lost.empty() || some_are_stuck;
}

}  // namespace sheaf::coordinator
