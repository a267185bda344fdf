// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that prefers work of scenes that the worker has (placement.h).
#include <algorithm>
#include <optional>
#include <tuple>

#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

void Scheduler::NoteWarm(const WorkerRecord& worker) {
  static const std::set<std::string> kNone;
  warm_workers_.Set(worker.worker_id, worker.numeric_profile,
                    worker.Live() ? worker.warm_scenes : kNone);
}

void Scheduler::NoteWork(JobRecord* job, const PackedDigest& scene) {
  std::set<uint64_t>& opened = opened_jobs_[job->spec.numeric_profile];
  if (job->ready.empty()) {
    opened.erase(job->spec.job_id);
  } else {
    opened.insert(job->spec.job_id);
  }
  if (job->pending.scene_count() > limits_.placement_scenes_max) return;
  const std::string hex = scene.Hex();
  const bool has_work =
      job->ready_by_scene.contains(hex) || job->pending.FirstOf(scene).has_value();
  scene_jobs_.Set(hex, job->spec.job_id, has_work);
}

bool Scheduler::IsLeased(const JobRecord& job, const WorkerRecord& worker) const {
  return job.phase == JobPhase::kLive && job.MayLease() &&
         job.spec.numeric_profile == worker.numeric_profile && MayServe(job, worker);
}

void Scheduler::SortByRight(std::span<const uint64_t> front, std::vector<uint64_t>* jobs) const {
  const auto key_of = [&](uint64_t id) {
    return std::tuple(-jobs_.at(id).spec.priority, std::ranges::find(front, id) - front.begin(),
                      id);
  };
  std::ranges::sort(*jobs, {}, key_of);
}

std::vector<uint64_t> Scheduler::OpenedJobs(const WorkerRecord& worker) const {
  std::vector<uint64_t> opened;
  const auto found = opened_jobs_.find(worker.numeric_profile);
  if (found == opened_jobs_.end()) return opened;
  int scanned = 0;
  for (const uint64_t id : found->second) {
    if (++scanned > limits_.placement_jobs_max) break;
    if (IsLeased(jobs_.at(id), worker)) opened.push_back(id);
  }
  SortByRight({}, &opened);
  return opened;
}

bool Scheduler::GrantPlaced(std::span<const uint64_t> front, WorkerRecord* worker, SteadyTime now) {
  const auto priority_of = [&](uint64_t id) { return jobs_.at(id).spec.priority; };
  while (!front.empty()) {
    const int32_t priority = priority_of(front[0]);
    const auto end = std::find_if(front.begin(), front.end(),
                                  [&](uint64_t id) { return priority_of(id) != priority; });
    const auto count = static_cast<size_t>(end - front.begin());
    if (GrantOfEquals(front.first(count), worker, now)) return true;
    front = front.subspan(count);
  }
  return false;
}

bool Scheduler::GrantOfEquals(std::span<const uint64_t> equals, WorkerRecord* worker,
                              SteadyTime now) {
  for (size_t i = 0; i < equals.size(); ++i) {
    JobRecord& job = jobs_.at(equals[i]);
    if (GrantWarm(&job, worker, now) ||
        (!MayPassOver(job, *worker, now) && GrantCold(&job, worker, now))) {
      NotePassedOver(equals.first(i), now);
      return true;
    }
  }
  NotePassedOver(equals, now);
  return GrantWarmOfEquals(equals, worker, now) || GrantColdOfEquals(equals, worker, now);
}

bool Scheduler::MayPassOver(const JobRecord& job, const WorkerRecord& worker,
                            SteadyTime now) const {
  return coordinator::MayPassOver({worker.cold_lease_time, job.passed_time}, now, limits_);
}

void Scheduler::NotePassedOver(std::span<const uint64_t> jobs, SteadyTime now) {
  for (const uint64_t id : jobs) {
    JobRecord& job = jobs_.at(id);
    job.passed_time = std::min(job.passed_time, now);
  }
}

bool Scheduler::GrantWarmOfEquals(std::span<const uint64_t> equals, WorkerRecord* worker,
                                  SteadyTime now) {
  const int32_t priority = jobs_.at(equals[0]).spec.priority;
  std::set<uint64_t> found;
  int scanned = 0;
  for (const std::string& scene : worker->warm_scenes) {
    for (const uint64_t id : scene_jobs_.Of(scene)) {
      if (++scanned > limits_.placement_jobs_max) break;
      const JobRecord& job = jobs_.at(id);
      if (IsLeased(job, *worker) && job.spec.priority == priority) found.insert(id);
    }
  }
  for (const uint64_t id : equals) {
    if (jobs_.at(id).pending.scene_count() > limits_.placement_scenes_max) found.insert(id);
  }
  std::vector<uint64_t> jobs(found.begin(), found.end());
  SortByRight(equals, &jobs);
  return std::any_of(jobs.begin(), jobs.end(),
                     [&](uint64_t id) { return GrantWarm(&jobs_.at(id), worker, now); });
}

bool Scheduler::GrantColdOfEquals(std::span<const uint64_t> equals, WorkerRecord* worker,
                                  SteadyTime now) {
  std::vector<ColdWork> choices;
  for (const uint64_t id : equals) {
    JobRecord& job = jobs_.at(id);
    choices.push_back({ColdScene(&job), SamplesToLease(job)});
  }
  const auto warm_count = [&](const std::string& scene) {
    return warm_workers_.CountOf(worker->numeric_profile, scene);
  };
  for (const size_t i : ColdOrder(choices, warm_count)) {
    if (GrantCold(&jobs_.at(equals[i]), worker, now)) return true;
  }
  return false;
}

bool Scheduler::GrantWarm(JobRecord* job, WorkerRecord* worker, SteadyTime now) {
  for (const std::string& scene : worker->warm_scenes) {
    if (const auto warm = job->ready_by_scene.find(scene); warm != job->ready_by_scene.end()) {
      if (GrantFromFrames(job, warm->second, worker, now)) return true;
    }
    if (const std::optional<uint32_t> warm = job->pending.FirstOf(PackedDigest(scene))) {
      if (GrantByOpening(job, *warm, worker, now)) return true;
    }
  }
  return false;
}

bool Scheduler::GrantCold(JobRecord* job, WorkerRecord* worker, SteadyTime now) {
  // A cold worker must load a scene anyway; on a frame of its own it stays warm for longest.
  if (!job->pending.empty() && GrantByOpening(job, job->pending.First(), worker, now)) return true;
  if (job->ready_by_scene.size() > 1) {
    std::vector<ColdWork> choices;
    for (const auto& [scene, frames] : job->ready_by_scene) {
      if (choices.size() >= static_cast<size_t>(limits_.job_scan_max)) break;
      const FrameRecord& first = job->frames[*frames.begin()];
      const auto samples = static_cast<double>(first.tasks->sample_count_ready());
      choices.push_back({scene, samples * static_cast<double>(frames.size())});
    }
    const auto warm_count = [&](const std::string& scene) {
      return warm_workers_.CountOf(worker->numeric_profile, scene);
    };
    for (const size_t i : ColdOrder(choices, warm_count)) {
      const auto found = job->ready_by_scene.find(choices[i].scene);
      if (found != job->ready_by_scene.end() && GrantFromFrames(job, found->second, worker, now)) {
        return true;
      }
    }
  }
  return GrantFromFrames(job, job->ready, worker, now);
}

std::string Scheduler::ColdScene(JobRecord* job) {
  if (!job->pending.empty() && MayOpen(job->frames[job->pending.First()])) {
    return job->frames[job->pending.First()].packed.scene().Hex();
  }
  return job->ready.empty() ? "" : job->frames[*job->ready.begin()].packed.scene().Hex();
}

double Scheduler::SamplesToLease(const JobRecord& job) const {
  double samples = 0;
  int scanned = 0;
  for (const uint32_t index : job.ready) {
    if (++scanned > limits_.placement_frames_max) break;
    samples += static_cast<double>(job.frames[index].tasks->sample_count_ready());
  }
  if (job.pending.empty()) return samples;
  // Frames of a job are mostly alike.
  const auto first = static_cast<double>(SampleCountTotal(job.frames[job.pending.First()]));
  return samples + first * job.pending.count();
}

}  // namespace sheaf::coordinator
