// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/scheduler.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/frame_image.h"
#include "coordinator/core/cell_grid.h"
#include "coordinator/core/job_check.h"

namespace sheaf::coordinator {
namespace {

uint64_t FirstRoundSamplesOf(const FrameRecord& frame) {
  const uint64_t samples = frame.settings().samples;
  const StopRule& stop = frame.stop();
  return stop.IsActive() ? std::min(samples, stop.first_round_samples) : samples;
}

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

uint64_t SampleCountTotal(const FrameRecord& frame) {
  if (frame.tasks != nullptr) return frame.tasks->sample_count_total();
  if (frame.phase == FrameRecord::Phase::kDelivered) return frame.sample_count_done;
  const FrameSettings& settings = frame.settings();
  const uint64_t paths = settings.lattice.All()
                             ? PathsPerSample(settings)
                             : static_cast<uint64_t>(settings.lattice.CountIn(settings.window));
  return paths * FirstRoundSamplesOf(frame);
}

std::optional<uint32_t> JobRecord::FindIndex(int32_t frame_number) const {
  const auto found = std::ranges::lower_bound(frames, frame_number, {}, &FrameRecord::number);
  if (found == frames.end() || found->number() != frame_number) return std::nullopt;
  return static_cast<uint32_t>(found - frames.begin());
}

uint32_t JobRecord::IndexOf(int32_t frame_number) const {
  const std::optional<uint32_t> index = FindIndex(frame_number);
  SHEAF_CHECK(index.has_value());
  return *index;
}

SteadyTime FirstLeaseTime(const JobRecord& job) {
  SteadyTime first = SteadyTime::InfiniteFuture();
  for (const FrameRecord& frame : job.frames) first = std::min(first, frame.first_lease_time);
  return first;
}

WorkLeft WorkLeftOf(const JobRecord& job, uint64_t sample_count_left) {
  double cpu_seconds = 0, samples = 0;
  for (const FrameRecord& frame : job.frames) {
    cpu_seconds += absl::ToDoubleSeconds(frame.cost.cpu_duration);
    samples += static_cast<double>(frame.sample_count_timed);
  }
  return {job.spec.priority, static_cast<double>(sample_count_left),
          samples > 0 ? cpu_seconds / samples : 0};
}

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
  return CheckJobSpec(spec, limits_);
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
              .priority = spec.priority,
              .partition = spec.partition,
              .numeric_profile = spec.numeric_profile,
              .frames = {},
              .effect_costs = spec.effect_costs};
  job.frames.resize(spec.frames.size());
  for (size_t i = 0; i < spec.frames.size(); ++i) {
    const PackedFrame& frame = job.frames[i].packed = PackedFrame(spec.frames[i], &job.shapes);
    live_frames_.Insert(frame.frame_digest(), {spec.job_id, frame.frame_number()});
  }
  job.pending = PendingFrames(static_cast<uint32_t>(job.frames.size()),
                              [&frames = job.frames](uint32_t i) -> const PackedDigest& {
                                return frames[i].packed.scene();
                              });
  // A new job begins level with the least served one, not with a claim on everybody's past.
  job.served = LeastServedBeside(job).value_or(0);
  ready_jobs_[spec.numeric_profile].insert(KeyOf(job));
  ++live_job_count_;
  job.work = WorkOf(spec);
  owner_work_[spec.owner] += job.work;
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

Scheduler::JobKey Scheduler::KeyOf(const JobRecord& job) {
  return {-job.spec.priority, job.served, job.spec.job_id};
}

void Scheduler::UpdateReadyJob(JobRecord* job, const JobKey& key_before) {
  std::set<JobKey>& ready = ready_jobs_[job->spec.numeric_profile];
  ready.erase(key_before);
  const bool has_work = !job->pending.empty() || !job->ready.empty();
  if (job->phase == JobPhase::kLive && has_work && !job->Paused()) ready.insert(KeyOf(*job));
}

void Scheduler::UpdateReady(JobRecord* job, uint32_t index) {
  const FrameRecord& frame = job->frames[index];
  if (frame.phase != FrameRecord::Phase::kPending) job->pending.Erase(index);
  if (frame.phase == FrameRecord::Phase::kOpen && frame.tasks->HasReady()) {
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
  UpdateReadyJob(job, KeyOf(*job));
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
}

Scheduler::FoundTask Scheduler::FindTask(const std::string& frame_digest, const PixelRect& tile,
                                         SampleBlock block, const TileCells& cells,
                                         uint64_t lease_id, TaskKind kind,
                                         const std::string& field) {
  const PackedDigest digest(frame_digest);
  std::vector<FrameId> candidates = live_frames_.Find(digest);
  // That which was leased comes first.
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
  frame.sample_count_done += samples;
  frame.sample_count_timed += samples;
  frame.cost.Add(cost);
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
  // A training has no samples: it says nothing of how fast the worker renders them.
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
  check_wait_ends_.erase(id);
  UpdateReady(&job, index);
}

bool Scheduler::Deliver(const FrameId& id) {
  JobRecord& job = jobs_.at(id.job_id);
  SHEAF_CHECK(Frame(id).phase == FrameRecord::Phase::kRendered);
  Close(&job, job.IndexOf(id.frame_number), FrameRecord::Phase::kDelivered);
  ++counters_.frames_delivered;
  ++job.delivered_count;
  JudgeIncompleteJob(&job);
  if (job.delivered_count < static_cast<int32_t>(job.frames.size())) return false;
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
    // Only a job that failed can be tried again.
    if (phase != JobPhase::kFailed) frame.failures.clear();
  }
  job.phase = phase;
  job.failure = failure;
  job.paused_time = SteadyTime::InfiniteFuture();
  UpdateReadyJob(&job, KeyOf(job));
  --live_job_count_;
  const auto of_owner = owner_work_.find(job.spec.owner);
  of_owner->second -= job.work;
  if (of_owner->second == OwnerWork()) owner_work_.erase(of_owner);
  ended_jobs_.push_back(job_id);
}

std::vector<uint64_t> Scheduler::TakeEndedJobs() { return std::exchange(ended_jobs_, {}); }

}  // namespace sheaf::coordinator
