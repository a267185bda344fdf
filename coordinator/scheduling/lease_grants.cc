// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/lease_grants.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/scene/settings/path_shares.h"
#include "coordinator/core/job/job_check.h"
#include "coordinator/scheduling/check_leases.h"
#include "coordinator/scheduling/frame_phases.h"
#include "coordinator/scheduling/lease_failures.h"
#include "coordinator/scheduling/placement/lease_length.h"
#include "coordinator/scheduling/share_limits.h"

namespace sheaf::coordinator::scheduling {
namespace {

// Whether a frame that this worker could render is between rounds, or will soon be.
bool RoundIsSoon(const WorkState& state, const WorkerRecord& worker, SteadyTime now) {
  if (worker.Draining() || now < worker.no_work_before) return false;
  int scanned = 0;
  for (const FrameId& id : state.round_frames) {
    if (++scanned > state.limits.job_scan_max) break;
    const JobRecord& job = state.jobs.at(id.job_id);
    if (job.MayLease() && job.spec.numeric_profile == worker.numeric_profile) return true;
  }
  return false;
}

int LeaseSlots(const WorkState& state, const JobRecord& job) {
  const int fair =
      state.workers.LiveSlots(job.spec.numeric_profile) / std::max(1, state.live_job_count);
  return std::max(fair, static_cast<int>(state.leases.CountOfJob(job.spec.job_id)));
}

uint64_t BlockSamplesMax(const WorkState& state, const JobRecord& job, const FrameRecord& frame,
                         const WorkerRecord& worker, const FrameTasks::FreshBlock& block) {
  if (block.kind == TaskKind::kTraining) return 1;
  const Partition& partition = job.spec.partition;
  // Passes of the whole frame.
  const bool is_light = block.kind == TaskKind::kLight || HasOneTile(frame.settings());
  const uint64_t passes_max = is_light ? LightPassesMax(frame.settings(), state.limits) : 0;
  const uint64_t pass = is_light ? 1 : partition.pass_sample_count;
  if (partition.lease_pass_count != 0) {
    const uint64_t samples =
        partition.pass_sample_count * (block.first == 0 ? 1 : partition.lease_pass_count);
    return is_light ? std::min(samples, passes_max) : samples;
  }
  const double seconds = block.first == 0 ? state.limits.first_lease_target_seconds
                         : is_light       ? state.limits.light_lease_target_seconds
                                          : state.limits.lease_target_seconds;
  const uint64_t first_max =
      std::max<uint64_t>(1, frame.settings().samples / state.limits.first_lease_fraction);
  return LeaseSamples(
      {.samples_per_second = SamplesPerThreadSecond(frame, worker) * ThreadsPerLease(worker),
       .target_seconds = seconds,
       .samples_left = static_cast<double>(frame.tasks->sample_count_ready()),
       .slots = LeaseSlots(state, job),
       .pixel_count = block.pixel_count,
       .samples_max = block.first == 0 ? first_max : 0,
       .pass_samples = pass,
       .passes_max = is_light ? passes_max : state.limits.lease_pass_count_max},
      state.limits);
}

bool MayRender(const WorkState& state, const FrameRecord& frame, const TaskId& task,
               const WorkerRecord& worker, SteadyTime now) {
  if (!MayOpenFor(state, frame, worker)) return false;
  const auto found = frame.failures.find(task);
  if (found == frame.failures.end()) return true;
  const TaskFailures& failures = found->second;
  if (now < failures.not_before) return false;
  if (!failures.trouble.set_aside.empty() || failures.IsFailedBy(worker.worker_id)) return false;
  return !failures.HasInfrastructureFailureOf(worker.worker_id) ||
         !OthersLive(state, state.jobs.at(task.frame.job_id).spec, failures.Workers());
}

bool GrantFromFrame(WorkState& state, JobRecord* job, uint32_t index, WorkerRecord* worker,
                    SteadyTime now) {
  FrameRecord& frame = job->frames[index];
  const FrameId id{job->spec.job_id, frame.number()};
  if (!MayOpenFor(state, frame, *worker)) return false;
  if (job->IsRefusedByCacheOf(worker->worker_id, now)) return false;
  std::optional<Task> task = frame.tasks->TakeReturned(
      [&](const Task& t) { return MayRender(state, frame, MakeTaskId(id, t), *worker, now); },
      state.limits.avoid_scan_max);
  if (!task) {
    task = frame.tasks->TakeFresh([&](const FrameTasks::FreshBlock& block) {
      return BlockSamplesMax(state, *job, frame, *worker, block);
    });
  }
  if (!task) return false;
  AddLease(state, job, &frame, *task, worker, /*is_check=*/false, now);
  UpdateReady(state, job, index);
  return true;
}

// Whether the task of this lease, its first, may be leased to the worker too.
bool MayHedge(WorkState& state, const Lease& first, const WorkerRecord& worker, SteadyTime now) {
  const JobRecord& job = state.jobs.at(first.frame.job_id);
  const FrameRecord& frame = Frame(state, first.frame);
  const TaskId task = MakeTaskId(first.frame, first.task);
  const std::vector<uint64_t> holders = state.leases.HoldersOf(task);
  if (holders.size() >= state.limits.hedge_holders_max) return false;
  const absl::Duration usual =
      ExpectedCpu(frame, first.task, absl::Seconds(state.limits.lease_target_seconds));
  const absl::Duration due =
      std::max(state.limits.overdue_min, state.limits.overdue_factor * usual);
  for (const uint64_t id : holders) {
    const Lease& held = *state.leases.Find(id);
    if (held.worker_id == worker.worker_id) return false;
    if (held.is_check && held.identity == worker.identity) return false;
    if (holders.size() > 1 && now - held.grant_time < due) return false;
  }
  if (AwaitsField(frame, first.task.tile)) return false;
  if (!job.MayLease() || job.spec.numeric_profile != worker.numeric_profile) return false;
  if (!MayServe(state, job, worker)) return false;
  return first.is_check ? MayCheck(state, task, worker, /*urgent_only=*/true)
                        : MayRender(state, frame, task, worker, now);
}

}  // namespace

size_t LeasesWanted(const WorkState& state, const WorkerRecord& worker) {
  const int threads = std::min(worker.thread_count, state.limits.threads_believed_max);
  const int unproven =
      std::max(state.limits.unproven_leases_min, state.limits.unproven_leases_per_thread * threads);
  const auto results = static_cast<int>(std::min<uint64_t>(
      worker.result_count, static_cast<uint64_t>(state.limits.leases_per_worker_max)));
  const int most = std::min(state.limits.leases_per_worker_max,
                            unproven + state.limits.leases_per_result * results);
  return static_cast<size_t>(std::clamp(worker.requested_lease_count, 0, most));
}

bool MayHoldMore(const WorkState& state, const WorkerRecord& worker) {
  return state.leases.CountOfIdentity(worker.identity) < state.limits.leases_per_identity_max;
}

absl::Duration BusyInterval(const WorkState& state) {
  return std::min(state.limits.heartbeat_interval_max, state.limits.lease_duration / 4);
}

absl::Duration NextSynchronize(const WorkState& state, const WorkerRecord& worker, SteadyTime now) {
  const absl::Duration busy = BusyInterval(state);
  if (!worker.leases.empty()) return busy;
  // Waiting workers share the call rate that the coordinator serves with ease.
  const absl::Duration fair =
      absl::Seconds(state.workers.LiveCount() / state.limits.synchronize_rate_max);
  const absl::Duration least = RoundIsSoon(state, worker, now) ? state.limits.round_interval_min
                                                               : state.limits.idle_interval_min;
  return std::min(std::max(least, fair), busy);
}

bool Grant(WorkState& state, WorkerRecord* worker, SteadyTime now) {
  return GrantCheck(state, worker, /*urgent_only=*/true, now) ||
         GrantFirstRender(state, worker, now) ||
         GrantCheck(state, worker, /*urgent_only=*/false, now);
}

bool GrantFromFrames(WorkState& state, JobRecord* job, const JobRecord::FrameSet& frames,
                     WorkerRecord* worker, SteadyTime now) {
  int scanned = 0;
  for (auto it = frames.begin(); it != frames.end() && scanned < state.limits.avoid_scan_max;
       ++scanned) {
    // A grant may remove the frame from the set, and the set with its last frame.
    const uint32_t index = *it++;
    if (GrantFromFrame(state, job, index, worker, now)) return true;
  }
  return false;
}

bool GrantByOpening(WorkState& state, JobRecord* job, uint32_t index, WorkerRecord* worker,
                    SteadyTime now) {
  if (!MayOpen(state, job->frames[index]) || IsHeld(state, job->frames[index])) return false;
  if (job->IsRefusedByCacheOf(worker->worker_id, now)) return false;
  Open(state, job, index);
  return GrantFromFrame(state, job, index, worker, now);
}

void AddLease(WorkState& state, JobRecord* job, FrameRecord* frame, const Task& task,
              WorkerRecord* worker, bool is_check, SteadyTime now) {
  Lease lease;
  lease.frame = {job->spec.job_id, frame->number()};
  lease.task = task;
  const CellGrid& grid = frame->tasks->grid();
  lease.kind = grid.KindOf(task.tile);
  lease.tile_rect = grid.RectOf(task.tile);
  lease.cells = grid.CellsOf(task.tile, task.cells);
  if (lease.kind != TaskKind::kTraining) lease.field = frame->tasks->field();
  lease.worker_id = worker->worker_id;
  lease.identity = worker->identity;
  lease.is_check = is_check;
  lease.grant_time = now;
  const auto failures = frame->failures.find(MakeTaskId(lease.frame, task));
  if (failures != frame->failures.end()) lease.attempt = failures->second.attempt_count;
  const Lease& stored = state.leases.Add(std::move(lease));
  worker->leases.insert(stored.lease_id);
  ++worker->lease_granted_count;
  ++state.counters.leases_granted;
  ChargeLease(state, *job, *worker, stored, frame->tasks->PixelSamples(task));
  if (worker->warm_scenes.insert(frame->packed.scene().Hex()).second) {
    ++worker->lease_cold_count;
    ++state.counters.leases_cold;
    worker->cold_lease_time = now;
  }
  if (!is_check) job->passed_time = SteadyTime::InfiniteFuture();
  frame->first_lease_time = std::min(frame->first_lease_time, now);
}

void NoteSpeed(WorkState& state, const FrameRecord& frame, const std::string& worker_id,
               uint64_t samples, const ResultCost& cost) {
  const double cpu_seconds = absl::ToDoubleSeconds(frame.cost.cpu_duration);
  WorkerRecord* worker = state.workers.Find(worker_id);
  if (worker == nullptr || frame.sample_count_timed == 0 || cpu_seconds <= 0) return;
  const double usual =
      cpu_seconds * static_cast<double>(samples) / static_cast<double>(frame.sample_count_timed);
  worker->NoteSpeed(usual, absl::ToDoubleSeconds(cost.cpu_duration));
}

bool MayOpenFor(const WorkState& state, const FrameRecord& frame, const WorkerRecord& worker) {
  return !frame.blocked && !frame.refused_by.contains(worker.worker_id) && !IsHeld(state, frame);
}

bool Hedge(WorkState& state, WorkerRecord* worker, SteadyTime now) {
  int scanned = 0;
  for (const LeaseTable::HedgeKey& key : state.leases.hedgeable()) {
    if (++scanned > state.limits.hedge_scan_max) return false;
    const Lease& first = *state.leases.Find(LeaseTable::LeaseIdOf(key));
    if (!MayHedge(state, first, *worker, now)) continue;
    ++state.counters.leases_hedged;
    const Task task = first.task;
    AddLease(state, &state.jobs.at(first.frame.job_id), &Frame(state, first.frame), task, worker,
             first.is_check, now);
    return true;
  }
  return false;
}

bool AwaitsField(const FrameRecord& frame, uint32_t tile) {
  const FrameTasks& tasks = *frame.tasks;
  return !tasks.Trained() && tasks.grid().KindOf(tile) != TaskKind::kTraining;
}

bool IsHeld(const WorkState& state, const FrameRecord& frame) {
  return !state.held_scenes.empty() && state.held_scenes.contains(frame.packed.scene().Hex());
}

}  // namespace sheaf::coordinator::scheduling
