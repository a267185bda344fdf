// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that grants leases.
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "coordinator/core/job/job_check.h"
#include "coordinator/scheduling/placement/lease_length.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

absl::StatusOr<Scheduler::SynchronizeAnswer> Scheduler::Synchronize(const WorkerReport& report,
                                                                    SteadyTime now) {
  ++counters_.synchronize_calls;
  Tick(now);
  const WorkerRecord* known = workers_.Find(report.worker_id);
  if (known != nullptr && known->identity != IdentityOf(report)) {
    return absl::PermissionDeniedError(absl::StrCat("the worker id ", report.worker_id,
                                                    " belongs to another certificate; start ",
                                                    "the worker again to get a new one"));
  }
  WorkerRecord* worker = workers_.Touch(report, now);
  if (worker == nullptr) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the farm has ", limits_.workers_max, " workers, the limit"));
  }
  ApplyReport(worker, report, now);
  CloseStuckFrames();
  if (worker->Quarantined()) {
    NoteWarm(*worker);
    return absl::PermissionDeniedError(
        absl::StrCat("worker ", report.worker_id, " is quarantined: ", worker->quarantine_reason));
  }
  for (const uint64_t id : worker->leases) {
    worker->warm_scenes.insert(Frame(leases_.Find(id)->frame).packed.scene().Hex());
  }
  const size_t wanted = worker->Sick() ? 0 : LeasesWanted(*worker);
  if (!worker->Draining() && now >= worker->no_work_before) {
    while (worker->leases.size() < wanted && MayHoldMore(*worker) && Grant(worker, now)) {
    }
    if (worker->leases.empty() && wanted > 0 && MayHoldMore(*worker)) Hedge(worker, now);
  }
  SynchronizeAnswer answer;
  for (const uint64_t id : worker->leases) answer.leases.push_back(*leases_.Find(id));
  NoteWarm(*worker);
  answer.next_synchronize = NextSynchronize(*worker, now);
  answer.exits = worker->drained_then_exit && worker->leases.empty();
  return answer;
}

size_t Scheduler::LeasesWanted(const WorkerRecord& worker) const {
  const int threads = std::min(worker.thread_count, limits_.threads_believed_max);
  const int unproven =
      std::max(limits_.unproven_leases_min, limits_.unproven_leases_per_thread * threads);
  const auto results = static_cast<int>(std::min<uint64_t>(
      worker.result_count, static_cast<uint64_t>(limits_.leases_per_worker_max)));
  const int most =
      std::min(limits_.leases_per_worker_max, unproven + limits_.leases_per_result * results);
  return static_cast<size_t>(std::clamp(worker.requested_lease_count, 0, most));
}

bool Scheduler::MayHoldMore(const WorkerRecord& worker) const {
  return leases_.CountOfIdentity(worker.identity) < limits_.leases_per_identity_max;
}

bool Scheduler::RoundIsSoon(const WorkerRecord& worker, SteadyTime now) const {
  if (worker.Draining() || now < worker.no_work_before) return false;
  int scanned = 0;
  for (const FrameId& id : round_frames_) {
    if (++scanned > limits_.job_scan_max) break;
    const JobRecord& job = jobs_.at(id.job_id);
    if (job.MayLease() && job.spec.numeric_profile == worker.numeric_profile) return true;
  }
  return false;
}

absl::Duration Scheduler::BusyInterval() const {
  return std::min(limits_.heartbeat_interval_max, limits_.lease_duration / 4);
}

absl::Duration Scheduler::NextSynchronize(const WorkerRecord& worker, SteadyTime now) const {
  const absl::Duration busy = BusyInterval();
  if (!worker.leases.empty()) return busy;
  // Waiting workers share the call rate that the coordinator serves with ease.
  const absl::Duration fair = absl::Seconds(workers_.LiveCount() / limits_.synchronize_rate_max);
  const absl::Duration least =
      RoundIsSoon(worker, now) ? limits_.round_interval_min : limits_.idle_interval_min;
  return std::min(std::max(least, fair), busy);
}

bool Scheduler::Grant(WorkerRecord* worker, SteadyTime now) {
  return GrantCheck(worker, /*urgent_only=*/true, now) || GrantFirstRender(worker, now) ||
         GrantCheck(worker, /*urgent_only=*/false, now);
}

bool Scheduler::GrantFromFrames(JobRecord* job, const JobRecord::FrameSet& frames,
                                WorkerRecord* worker, SteadyTime now) {
  int scanned = 0;
  for (auto it = frames.begin(); it != frames.end() && scanned < limits_.avoid_scan_max;
       ++scanned) {
    // A grant may remove the frame from the set, and the set with its last frame.
    const uint32_t index = *it++;
    if (GrantFromFrame(job, index, worker, now)) return true;
  }
  return false;
}

bool Scheduler::GrantByOpening(JobRecord* job, uint32_t index, WorkerRecord* worker,
                               SteadyTime now) {
  if (!MayOpen(job->frames[index]) || IsHeld(job->frames[index])) return false;
  if (job->IsRefusedByCacheOf(worker->worker_id, now)) return false;
  Open(job, index);
  return GrantFromFrame(job, index, worker, now);
}

bool Scheduler::GrantFromFrame(JobRecord* job, uint32_t index, WorkerRecord* worker,
                               SteadyTime now) {
  FrameRecord& frame = job->frames[index];
  const FrameId id{job->spec.job_id, frame.number()};
  if (!MayOpenFor(frame, *worker)) return false;
  if (job->IsRefusedByCacheOf(worker->worker_id, now)) return false;
  std::optional<Task> task = frame.tasks->TakeReturned(
      [&](const Task& t) { return MayRender(frame, MakeTaskId(id, t), *worker, now); },
      limits_.avoid_scan_max);
  if (!task) {
    task = frame.tasks->TakeFresh([&](const FrameTasks::FreshBlock& block) {
      return BlockSamplesMax(*job, frame, *worker, block);
    });
  }
  if (!task) return false;
  AddLease(job, &frame, *task, worker, /*is_check=*/false, now);
  UpdateReady(job, index);
  return true;
}

void Scheduler::AddLease(JobRecord* job, FrameRecord* frame, const Task& task, WorkerRecord* worker,
                         bool is_check, SteadyTime now) {
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
  const Lease& stored = leases_.Add(std::move(lease));
  worker->leases.insert(stored.lease_id);
  ++worker->lease_granted_count;
  ++counters_.leases_granted;
  ChargeLease(*job, *worker, stored, frame->tasks->PixelSamples(task));
  if (worker->warm_scenes.insert(frame->packed.scene().Hex()).second) {
    ++worker->lease_cold_count;
    ++counters_.leases_cold;
    worker->cold_lease_time = now;
  }
  if (!is_check) job->passed_time = SteadyTime::InfiniteFuture();
  frame->first_lease_time = std::min(frame->first_lease_time, now);
}

void Scheduler::NoteSpeed(const FrameRecord& frame, const std::string& worker_id, uint64_t samples,
                          const ResultCost& cost) {
  const double cpu_seconds = absl::ToDoubleSeconds(frame.cost.cpu_duration);
  WorkerRecord* worker = workers_.Find(worker_id);
  if (worker == nullptr || frame.sample_count_timed == 0 || cpu_seconds <= 0) return;
  const double usual =
      cpu_seconds * static_cast<double>(samples) / static_cast<double>(frame.sample_count_timed);
  worker->NoteSpeed(usual, absl::ToDoubleSeconds(cost.cpu_duration));
}

int Scheduler::LeaseSlots(const JobRecord& job) const {
  const int fair = workers_.LiveSlots(job.spec.numeric_profile) / std::max(1, live_job_count_);
  return std::max(fair, static_cast<int>(leases_.CountOfJob(job.spec.job_id)));
}

uint64_t Scheduler::BlockSamplesMax(const JobRecord& job, const FrameRecord& frame,
                                    const WorkerRecord& worker,
                                    const FrameTasks::FreshBlock& block) const {
  if (block.kind == TaskKind::kTraining) return 1;
  const Partition& partition = job.spec.partition;
  const bool is_light = block.kind == TaskKind::kLight;
  const uint64_t passes_max = is_light ? LightPassesMax(frame.settings(), limits_) : 0;
  const uint64_t pass = is_light ? 1 : partition.pass_sample_count;
  if (partition.lease_pass_count != 0) {
    const uint64_t samples =
        partition.pass_sample_count * (block.first == 0 ? 1 : partition.lease_pass_count);
    return is_light ? std::min(samples, passes_max) : samples;
  }
  const double seconds = block.first == 0 ? limits_.first_lease_target_seconds
                         : is_light       ? limits_.light_lease_target_seconds
                                          : limits_.lease_target_seconds;
  const uint64_t first_max =
      std::max<uint64_t>(1, frame.settings().samples / limits_.first_lease_fraction);
  return LeaseSamples(
      {.samples_per_second = SamplesPerThreadSecond(frame, worker) * ThreadsPerLease(worker),
       .target_seconds = seconds,
       .samples_left = static_cast<double>(frame.tasks->sample_count_ready()),
       .slots = LeaseSlots(job),
       .pixel_count = block.pixel_count,
       .samples_max = block.first == 0 ? first_max : 0,
       .pass_samples = pass,
       .passes_max = is_light ? passes_max : limits_.lease_pass_count_max},
      limits_);
}

bool Scheduler::MayOpenFor(const FrameRecord& frame, const WorkerRecord& worker) const {
  return !frame.blocked && !frame.refused_by.contains(worker.worker_id) && !IsHeld(frame);
}

bool Scheduler::MayRender(const FrameRecord& frame, const TaskId& task, const WorkerRecord& worker,
                          SteadyTime now) const {
  if (!MayOpenFor(frame, worker)) return false;
  const auto found = frame.failures.find(task);
  if (found == frame.failures.end()) return true;
  const TaskFailures& failures = found->second;
  if (now < failures.not_before) return false;
  if (!failures.trouble.set_aside.empty() || failures.IsFailedBy(worker.worker_id)) return false;
  return !failures.HasInfrastructureFailureOf(worker.worker_id) ||
         !OthersLive(jobs_.at(task.frame.job_id).spec, failures.Workers());
}

bool Scheduler::MayHedge(const Lease& first, const WorkerRecord& worker, SteadyTime now) {
  const JobRecord& job = jobs_.at(first.frame.job_id);
  const FrameRecord& frame = Frame(first.frame);
  const TaskId task = MakeTaskId(first.frame, first.task);
  const std::vector<uint64_t> holders = leases_.HoldersOf(task);
  if (holders.size() >= limits_.hedge_holders_max) return false;
  const absl::Duration usual =
      ExpectedCpu(frame, first.task, absl::Seconds(limits_.lease_target_seconds));
  const absl::Duration due = std::max(limits_.overdue_min, limits_.overdue_factor * usual);
  for (const uint64_t id : holders) {
    const Lease& held = *leases_.Find(id);
    if (held.worker_id == worker.worker_id) return false;
    if (held.is_check && held.identity == worker.identity) return false;
    if (holders.size() > 1 && now - held.grant_time < due) return false;
  }
  if (AwaitsField(frame, first.task.tile)) return false;
  if (!job.MayLease() || job.spec.numeric_profile != worker.numeric_profile) return false;
  if (!MayServe(job, worker)) return false;
  return first.is_check ? MayCheck(task, worker, /*urgent_only=*/true)
                        : MayRender(frame, task, worker, now);
}

bool Scheduler::Hedge(WorkerRecord* worker, SteadyTime now) {
  int scanned = 0;
  for (const LeaseTable::HedgeKey& key : leases_.hedgeable()) {
    if (++scanned > limits_.hedge_scan_max) return false;
    const Lease& first = *leases_.Find(LeaseTable::LeaseIdOf(key));
    if (!MayHedge(first, *worker, now)) continue;
    ++counters_.leases_hedged;
    const Task task = first.task;
    AddLease(&jobs_.at(first.frame.job_id), &Frame(first.frame), task, worker, first.is_check, now);
    return true;
  }
  return false;
}

}  // namespace sheaf::coordinator
