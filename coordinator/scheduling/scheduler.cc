// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/scheduler.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/frame_image.h"
#include "coordinator/core/job/cell_grid.h"
#include "coordinator/core/job/job_approval.h"
#include "coordinator/core/job/job_check.h"

namespace sheaf::coordinator {
namespace {

// The size of an open frame: its pixels, in units of an image without outputs.
int64_t OpenPixelsOf(const FrameSettings& settings) {
  const auto channel_count = static_cast<int64_t>(ImageChannelCount(settings.outputs));
  constexpr auto kUnit = static_cast<int64_t>(kImageChannelCountMin);
  // With light passes: the images of the camera and of the light paths, and their sum.
  const int64_t image_count = HasLightPasses(settings) ? 3 : 1;
  return image_count * settings.window.PixelCount() * ((channel_count + kUnit - 1) / kUnit);
}

void GrowTasks(std::span<const uint64_t> samples, FrameTasks* tasks) {
  SHEAF_CHECK(samples.size() == tasks->grid().cells().size());
  for (uint32_t cell = 0; cell < samples.size(); ++cell) tasks->Grow(cell, samples[cell]);
}

}  // namespace

Scheduler::Scheduler(const Limits& limits, uint64_t first_lease_id)
    : limits_(limits),
      workers_(limits_),
      leases_(first_lease_id),
      checks_(limits_.result_versions_max) {}

absl::Status Scheduler::CheckJob(const JobSpec& spec) const {
  if (live_job_count_ >= limits_.live_jobs_max) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "there are ", live_job_count_, " unfinished jobs, the limit; try again later"));
  }
  if (absl::Status status = CheckPriority(spec.priority); !status.ok()) return status;
  if (!requirement_groups_.HasRoom(spec.requirements, limits_.requirement_groups_max)) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "the unfinished jobs have ", limits_.requirement_groups_max,
        " different requirements of workers, the limit; use a pool or tags that others use, or "
        "try again later"));
  }
  if (absl::Status status = CheckDependencies(spec); !status.ok()) return status;
  if (spec.approvals.empty()) return CheckJobSpec(spec, limits_);
  JobSpec approved = spec;
  approved.frames = ApprovedFrames(spec);
  return CheckJobSpec(approved, limits_);
}

absl::Status Scheduler::CheckOwner(const JobSpec& spec) {
  if (spec.owner == kLocalOwner) return absl::OkStatus();
  const auto found = owner_work_.find(spec.owner);
  const OwnerWork present = found == owner_work_.end() ? OwnerWork() : found->second;
  absl::Status allowed = CheckOwnerWork(present, WorkOf(spec), limits_);
  if (!allowed.ok()) ++counters_.jobs_refused;
  return allowed;
}

void Scheduler::AddJob(const JobSpec& spec) {
  const auto [it, is_new] = jobs_.emplace(spec.job_id, JobRecord{});
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
              .deadline = spec.deadline};
  job.frames.resize(spec.frames.size());
  for (size_t i = 0; i < spec.frames.size(); ++i) {
    const PackedFrame& frame = job.frames[i].packed = PackedFrame(spec.frames[i], &job.shapes);
    live_frames_.Insert(frame.frame_digest(), {spec.job_id, frame.frame_number()});
  }
  job.pending = PendingFrames(static_cast<uint32_t>(job.frames.size()),
                              [&frames = job.frames](uint32_t i) -> const PackedDigest& {
                                return frames[i].packed.scene();
                              });
  job.requirement_group = requirement_groups_.Add(spec.requirements);
  shares_.AddJob({spec.job_id, spec.numeric_profile, spec.priority, spec.show, spec.owner,
                  job.requirement_group});
  for (const uint32_t index : job.pending.FirstOfScenes(limits_.placement_scenes_max)) {
    NoteWork(&job, job.frames[index].packed.scene());
  }
  UpdateReadyJob(&job);
  ++live_job_count_;
  job.work = WorkOf(spec);
  owner_work_[spec.owner] += job.work;
  dependents_.Add(spec);
  JudgeDependencies(&job);
  JudgeDependents(spec.job_id);  // It may have existed before, as an ended job.
}

void Scheduler::RemoveJob(uint64_t job_id) {
  SHEAF_CHECK(jobs_.at(job_id).phase != JobPhase::kLive);
  jobs_.erase(job_id);
}

void Scheduler::RestoreEnded(uint64_t job_id, JobPhase phase, const std::string& failure) {
  EndJob(job_id, phase, failure);
  std::erase(ended_jobs_, job_id);
}

void Scheduler::RestoreDelivered(const FrameId& id, const ResultCost& cost, uint64_t sample_count) {
  JobRecord& job = jobs_.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  FrameRecord& frame = job.frames[index];
  frame.sample_count_done = frame.sample_count_timed = sample_count;
  frame.cost = cost;
  ++job.delivered_count;
  Close(&job, index, FrameRecord::Phase::kDelivered);
}

void Scheduler::RestoreRound(const FrameId& id, std::span<const uint64_t> samples) {
  JobRecord& job = jobs_.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  if (job.frames[index].phase == FrameRecord::Phase::kPending) Open(&job, index);
  FrameTasks* tasks = job.frames[index].tasks.get();
  std::vector<uint64_t> grown = tasks->SamplesOfCells();
  SHEAF_CHECK(samples.size() == grown.size());
  for (size_t i = 0; i < grown.size(); ++i) grown[i] = std::max(grown[i], samples[i]);
  GrowTasks(grown, tasks);
  UpdateReady(&job, index);
}

FrameTasks::Fit Scheduler::RestorePart(const FrameId& id, const PixelRect& tile, SampleBlock block,
                                       const TileCells& cells, const ResultCost& cost,
                                       TaskKind kind) {
  JobRecord& job = jobs_.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  FrameRecord& frame = job.frames[index];
  if (frame.phase == FrameRecord::Phase::kPending) Open(&job, index);
  const std::optional<Task> task_there = frame.tasks->Find(tile, block, cells, kind);
  if (!task_there) return FrameTasks::Fit::kPartial;
  const Task& task = *task_there;
  const FrameTasks::Fit fit = frame.tasks->FitOf(task);
  if (fit != FrameTasks::Fit::kWanted) return fit;
  frame.tasks->Accept(task, cost.cpu_duration);
  NoteLoaded(id);
  frame.sample_count_done = frame.tasks->sample_count_done();
  if (cost.cpu_duration > absl::ZeroDuration()) {
    frame.sample_count_timed += frame.tasks->PixelSamples(task);
  }
  frame.cost.Add(cost);
  shares_.NoteCost(id.job_id, frame.tasks->PixelSamples(task), cost.cpu_duration);
  if (frame.tasks->Complete()) frame.phase = FrameRecord::Phase::kRendered;
  UpdateReady(&job, index);
  return fit;
}

const FrameRecord* Scheduler::FindFrame(const FrameId& id) const {
  const auto job = jobs_.find(id.job_id);
  if (job == jobs_.end()) return nullptr;
  const std::optional<uint32_t> index = job->second.FindIndex(id.frame_number);
  return index ? &job->second.frames[*index] : nullptr;
}

FrameRecord& Scheduler::Frame(const FrameId& id) {
  JobRecord& job = jobs_.at(id.job_id);
  return job.frames[job.IndexOf(id.frame_number)];
}

void Scheduler::UpdateReadyJob(JobRecord* job) {
  if (job->phase != JobPhase::kLive) return;
  const bool has_work = !job->pending.empty() || !job->ready.empty();
  shares_.SetReady(job->spec.job_id, has_work && job->MayLease());
}

void Scheduler::UpdateReady(JobRecord* job, uint32_t index) {
  const FrameRecord& frame = job->frames[index];
  const bool is_pending = frame.phase == FrameRecord::Phase::kPending && !frame.blocked;
  is_pending ? job->pending.Insert(index) : job->pending.Erase(index);
  if (frame.phase == FrameRecord::Phase::kOpen && !frame.blocked && frame.tasks->HasReady()) {
    job->ready.insert(index);
    job->ready_by_scene[frame.packed.scene().Hex()].insert(index);
  } else if (job->ready.erase(index) > 0) {
    const auto of_scene = job->ready_by_scene.find(frame.packed.scene().Hex());
    of_scene->second.erase(index);
    if (of_scene->second.empty()) job->ready_by_scene.erase(of_scene);
  }
  if (frame.phase == FrameRecord::Phase::kOpen && frame.tasks->Stuck()) {
    stuck_frames_.insert({job->spec.job_id, frame.number()});
  }
  NoteWork(job, frame.packed.scene());
  UpdateReadyJob(job);
}

bool Scheduler::MayOpen(const FrameRecord& frame) const {
  return open_pixels_ == 0 ||
         open_pixels_ + OpenPixelsOf(frame.settings()) <= limits_.open_pixels_max;
}

void Scheduler::Open(JobRecord* job, uint32_t index) {
  FrameRecord& frame = job->frames[index];
  SHEAF_CHECK(frame.phase == FrameRecord::Phase::kPending);
  const FrameSettings& settings = frame.settings();
  frame.tasks = std::make_unique<FrameTasks>(CellGrid(frame.Spec(), job->spec.partition),
                                             FirstRoundSamplesOf(frame), settings.lattice,
                                             PathsPerLightPass(settings));
  frame.phase = FrameRecord::Phase::kOpen;
  open_pixels_ += OpenPixelsOf(settings);
  if (frame.stop().IsActive()) round_frames_.insert({job->spec.job_id, frame.number()});
  UpdateReady(job, index);
}

void Scheduler::Close(JobRecord* job, uint32_t index, FrameRecord::Phase phase) {
  FrameRecord& frame = job->frames[index];
  if (frame.tasks != nullptr) open_pixels_ -= OpenPixelsOf(frame.settings());
  frame.tasks.reset();
  frame.phase = phase;
  const FrameId id{job->spec.job_id, frame.number()};
  if (phase == FrameRecord::Phase::kDelivered) ForgetTroubles(&frame);
  DropChecks(id);
  doubtful_frames_.erase(id);
  round_frames_.erase(id);
  live_frames_.Erase(frame.packed.frame_digest(), id);
  UpdateReady(job, index);
  if (phase != FrameRecord::Phase::kDelivered) return;
  if (IsUnapproved(job->spec, id.frame_number)) ++job->unapproved_count;
  JudgeDependentsOn(id);
}

Scheduler::FoundTask Scheduler::FindTask(const std::string& frame_digest, const PixelRect& tile,
                                         SampleBlock block, const TileCells& cells,
                                         uint64_t lease_id, TaskKind kind,
                                         const std::string& field) {
  const PackedDigest digest(frame_digest);
  std::vector<FrameId> candidates = live_frames_.Find(digest);
  // Leased tasks come first.
  if (const Lease* lease = leases_.Find(lease_id)) {
    candidates.insert(candidates.begin(), lease->frame);
  }
  FoundTask best;
  for (const FrameId& id : candidates) {
    JobRecord& job = jobs_.at(id.job_id);
    const uint32_t index = job.IndexOf(id.frame_number);
    FrameRecord& frame = job.frames[index];
    if (frame.packed.frame_digest() != digest) continue;
    if (frame.phase == FrameRecord::Phase::kPending) {
      if (!MayOpen(frame)) continue;
      Open(&job, index);
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
  JobRecord& job = jobs_.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  FrameRecord& frame = job.frames[index];
  const Lease* lease = leases_.Find(lease_id);
  if (lease == nullptr) ++counters_.results_late;
  const SteadyTime grant_time = lease == nullptr ? SteadyTime::InfiniteFuture() : lease->grant_time;
  if (lease != nullptr && lease->frame == id && lease->task == task) {
    ChargeResult(*lease, cost, now);
  }
  std::map<std::string, std::string> suspects;
  const auto forget_failures = [&](const TaskId& rendered) {
    const auto failures = frame.failures.find(rendered);
    if (failures == frame.failures.end()) return;
    suspects.merge(failures->second.suspects);
    ForgetTrouble(&frame, rendered);
  };
  for (const Task& aside : frame.tasks->AsideOverlapping(task)) {
    forget_failures(MakeTaskId(id, aside));
  }
  for (const Task& covered : frame.tasks->Accept(task, cost.cpu_duration)) {
    for (const uint64_t holder : leases_.HoldersOf(MakeTaskId(id, covered))) {
      if (holder != lease_id) ++counters_.leases_cancelled;
      DropLease(holder, /*put_back=*/false);
    }
    forget_failures(MakeTaskId(id, covered));
  }
  forget_failures(MakeTaskId(id, task));
  NoteLoaded(id);
  const uint64_t samples = frame.tasks->PixelSamples(task);
  NoteSpeed(frame, worker_id, samples, cost);
  frame.sample_count_done += samples;
  frame.sample_count_timed += samples;
  frame.cost.Add(cost);
  shares_.NoteCost(id.job_id, samples, cost.cpu_duration);
  ++counters_.results_accepted;
  counters_.samples_accepted += samples;
  counters_.rays_accepted += cost.ray_count;
  counters_.nonfinite_samples += cost.nonfinite_count;
  NoteDelivery(worker_id, samples, cost, grant_time, now);
  if (frame.tasks->Complete()) frame.phase = FrameRecord::Phase::kRendered;
  UpdateReady(&job, index);
  BlameSuspects(suspects, id.job_id, worker_id, now);
  return frame.phase == FrameRecord::Phase::kRendered;
}

void Scheduler::NoteDelivery(const std::string& worker_id, uint64_t samples, const ResultCost& cost,
                             SteadyTime grant_time, SteadyTime now) {
  WorkerRecord* worker = workers_.Find(worker_id);
  if (worker == nullptr) return;
  workers_.NoteResult(worker->identity);
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

void Scheduler::Revoke(const FrameId& id, const Task& task) {
  JobRecord& job = jobs_.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  FrameRecord& frame = job.frames[index];
  if (frame.tasks == nullptr) return;
  DropCheckLeases(MakeTaskId(id, task));
  checks_.Erase(MakeTaskId(id, task));
  frame.tasks->Revoke(task);
  // A rendered frame needs no field.
  if (!frame.tasks->Complete()) frame.phase = FrameRecord::Phase::kOpen;
  frame.sample_count_done = frame.tasks->sample_count_done();
  ++counters_.parts_revoked;
  UpdateReady(&job, index);
}

void Scheduler::Grow(const FrameId& id, std::span<const uint64_t> samples) {
  JobRecord& job = jobs_.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  FrameRecord& frame = job.frames[index];
  SHEAF_CHECK(frame.phase == FrameRecord::Phase::kRendered);
  GrowTasks(samples, frame.tasks.get());
  if (!frame.tasks->Complete()) frame.phase = FrameRecord::Phase::kOpen;
  if (const auto wait = check_waits_.find(id); wait != check_waits_.end() && wait->second.waits) {
    check_waits_.erase(wait);
  }
  UpdateReady(&job, index);
}

bool Scheduler::Deliver(const FrameId& id) {
  JobRecord& job = jobs_.at(id.job_id);
  SHEAF_CHECK(Frame(id).phase == FrameRecord::Phase::kRendered);
  Close(&job, job.IndexOf(id.frame_number), FrameRecord::Phase::kDelivered);
  ++counters_.frames_delivered;
  ++job.delivered_count;
  JudgeIncompleteJob(&job);
  const int32_t done_count = job.delivered_count - job.unapproved_count;
  if (done_count < static_cast<int32_t>(job.frames.size())) return false;
  EndJob(id.job_id, JobPhase::kSucceeded, "");
  return true;
}

void Scheduler::EndJob(uint64_t job_id, JobPhase phase, const std::string& failure) {
  JobRecord& job = jobs_.at(job_id);
  if (job.phase != JobPhase::kLive) return;
  for (const uint64_t lease_id : leases_.OfJob(job_id)) {
    ++counters_.leases_cancelled;
    DropLease(lease_id, /*put_back=*/true);
  }
  for (uint32_t i = 0; i < job.frames.size(); ++i) {
    FrameRecord& frame = job.frames[i];
    const bool has_ended = frame.phase == FrameRecord::Phase::kDelivered ||
                           frame.phase == FrameRecord::Phase::kIncomplete;
    if (!has_ended) Close(&job, i, FrameRecord::Phase::kClosed);
    // Only a failed job can be retried.
    if (phase != JobPhase::kFailed) frame.failures.clear();
  }
  job.phase = phase;
  job.failure = failure;
  job.paused_time = SteadyTime::InfiniteFuture();
  shares_.RemoveJob(job_id);
  requirement_groups_.Release(job.requirement_group);
  --live_job_count_;
  const auto of_owner = owner_work_.find(job.spec.owner);
  of_owner->second -= job.work;
  if (of_owner->second == OwnerWork()) owner_work_.erase(of_owner);
  ended_jobs_.push_back(job_id);
  dependents_.Erase(job.spec);
  JudgeDependents(job_id);
}

std::vector<uint64_t> Scheduler::TakeEndedJobs() { return std::exchange(ended_jobs_, {}); }

}  // namespace sheaf::coordinator
