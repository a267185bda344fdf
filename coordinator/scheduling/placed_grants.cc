// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/placed_grants.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/scheduling/frame_phases.h"
#include "coordinator/scheduling/lease_grants.h"
#include "coordinator/scheduling/share_limits.h"

namespace sheaf::coordinator::scheduling {
namespace {

// Whether the job's work may be leased to the worker now.
bool IsLeased(const WorkState& state, const JobRecord& job, const WorkerRecord& worker) {
  return job.phase == JobPhase::kLive && job.MayLease() &&
         job.spec.numeric_profile == worker.numeric_profile && MayServe(state, job, worker);
}

// Sorts by priority, then as in `front`, whose jobs come before others.
void SortByRight(const WorkState& state, std::span<const uint64_t> front,
                 std::vector<uint64_t>* jobs) {
  const auto key_of = [&](uint64_t id) {
    return std::tuple(-state.jobs.at(id).spec.priority,
                      std::ranges::find(front, id) - front.begin(), id);
  };
  std::ranges::sort(*jobs, {}, key_of);
}

bool MayPassOver(const WorkState& state, const JobRecord& job, const WorkerRecord& worker,
                 SteadyTime now) {
  return coordinator::MayPassOver({worker.cold_lease_time, job.passed_time}, now, state.limits);
}

void NotePassedOver(WorkState& state, std::span<const uint64_t> jobs, SteadyTime now) {
  for (const uint64_t id : jobs) {
    JobRecord& job = state.jobs.at(id);
    job.passed_time = std::min(job.passed_time, now);
  }
}

bool GrantWarmOfEquals(WorkState& state, std::span<const uint64_t> equals, WorkerRecord* worker,
                       SteadyTime now) {
  const int32_t priority = state.jobs.at(equals[0]).spec.priority;
  std::set<uint64_t> found;
  int scanned = 0;
  for (const std::string& scene : worker->warm_scenes) {
    for (const uint64_t id : state.placing.scene_jobs.Of(scene)) {
      if (++scanned > state.limits.placement_jobs_max) break;
      const JobRecord& job = state.jobs.at(id);
      if (IsLeased(state, job, *worker) && job.spec.priority == priority) found.insert(id);
    }
  }
  for (const uint64_t id : equals) {
    if (state.jobs.at(id).pending.scene_count() > state.limits.placement_scenes_max)
      found.insert(id);
  }
  std::vector<uint64_t> jobs(found.begin(), found.end());
  SortByRight(state, equals, &jobs);
  return std::any_of(jobs.begin(), jobs.end(), [&](uint64_t id) {
    return GrantWarm(state, &state.jobs.at(id), worker, now);
  });
}

bool GrantCold(WorkState& state, JobRecord* job, WorkerRecord* worker, SteadyTime now) {
  // A cold worker must load a scene anyway; on a frame of its own it stays warm for longest.
  if (!job->pending.empty() && GrantByOpening(state, job, job->pending.First(), worker, now))
    return true;
  if (job->ready_by_scene.size() > 1) {
    std::vector<ColdWork> choices;
    for (const auto& [scene, frames] : job->ready_by_scene) {
      if (choices.size() >= static_cast<size_t>(state.limits.job_scan_max)) break;
      const FrameRecord& first = job->frames[*frames.begin()];
      const auto samples = static_cast<double>(first.tasks->sample_count_ready());
      choices.push_back({scene, samples * static_cast<double>(frames.size())});
    }
    const auto warm_count = [&](const std::string& scene) {
      return state.placing.warm_workers.CountOf(worker->numeric_profile, scene);
    };
    for (const size_t i : ColdOrder(choices, warm_count)) {
      const auto found = job->ready_by_scene.find(choices[i].scene);
      if (found != job->ready_by_scene.end() &&
          GrantFromFrames(state, job, found->second, worker, now)) {
        return true;
      }
    }
  }
  return GrantFromFrames(state, job, job->ready, worker, now);
}

// The scene with which a cold worker would begin the job; empty if it cannot.
std::string ColdScene(WorkState& state, JobRecord* job) {
  if (!job->pending.empty() && MayOpen(state, job->frames[job->pending.First()])) {
    return job->frames[job->pending.First()].packed.scene().Hex();
  }
  return job->ready.empty() ? "" : job->frames[*job->ready.begin()].packed.scene().Hex();
}

// Approximate number of pixel samples of the job that can be leased.
double SamplesToLease(const WorkState& state, const JobRecord& job) {
  double samples = 0;
  int scanned = 0;
  for (const uint32_t index : job.ready) {
    if (++scanned > state.limits.placement_frames_max) break;
    samples += static_cast<double>(job.frames[index].tasks->sample_count_ready());
  }
  if (job.pending.empty()) return samples;
  // Frames of a job are mostly alike.
  const auto first = static_cast<double>(SampleCountTotal(job.frames[job.pending.First()]));
  return samples + first * job.pending.count();
}

bool GrantColdOfEquals(WorkState& state, std::span<const uint64_t> equals, WorkerRecord* worker,
                       SteadyTime now) {
  std::vector<ColdWork> choices;
  for (const uint64_t id : equals) {
    JobRecord& job = state.jobs.at(id);
    choices.push_back({ColdScene(state, &job), SamplesToLease(state, job)});
  }
  const auto warm_count = [&](const std::string& scene) {
    return state.placing.warm_workers.CountOf(worker->numeric_profile, scene);
  };
  for (const size_t i : ColdOrder(choices, warm_count)) {
    if (GrantCold(state, &state.jobs.at(equals[i]), worker, now)) return true;
  }
  return false;
}

bool GrantOfEquals(WorkState& state, std::span<const uint64_t> equals, WorkerRecord* worker,
                   SteadyTime now) {
  for (size_t i = 0; i < equals.size(); ++i) {
    JobRecord& job = state.jobs.at(equals[i]);
    if (GrantWarm(state, &job, worker, now) ||
        (!MayPassOver(state, job, *worker, now) && GrantCold(state, &job, worker, now))) {
      NotePassedOver(state, equals.first(i), now);
      return true;
    }
  }
  NotePassedOver(state, equals, now);
  return GrantWarmOfEquals(state, equals, worker, now) ||
         GrantColdOfEquals(state, equals, worker, now);
}

}  // namespace

void NoteWarm(WorkState& state, const WorkerRecord& worker) {
  static const std::set<std::string> kNone;
  state.placing.warm_workers.Set(worker.worker_id, worker.numeric_profile,
                                 worker.Live() ? worker.warm_scenes : kNone);
}

void NoteWork(WorkState& state, JobRecord* job, const PackedDigest& scene) {
  std::set<uint64_t>& opened = state.placing.opened_jobs[job->spec.numeric_profile];
  if (job->ready.empty()) {
    opened.erase(job->spec.job_id);
  } else {
    opened.insert(job->spec.job_id);
  }
  if (job->pending.scene_count() > state.limits.placement_scenes_max) return;
  const std::string hex = scene.Hex();
  const bool has_work =
      job->ready_by_scene.contains(hex) || job->pending.FirstOf(scene).has_value();
  state.placing.scene_jobs.Set(hex, job->spec.job_id, has_work);
}

std::vector<uint64_t> OpenedJobs(const WorkState& state, const WorkerRecord& worker) {
  std::vector<uint64_t> opened;
  const auto found = state.placing.opened_jobs.find(worker.numeric_profile);
  if (found == state.placing.opened_jobs.end()) return opened;
  int scanned = 0;
  for (const uint64_t id : found->second) {
    if (++scanned > state.limits.placement_jobs_max) break;
    if (IsLeased(state, state.jobs.at(id), worker)) opened.push_back(id);
  }
  SortByRight(state, {}, &opened);
  return opened;
}

bool GrantPlaced(WorkState& state, std::span<const uint64_t> front, WorkerRecord* worker,
                 SteadyTime now) {
  const auto priority_of = [&](uint64_t id) { return state.jobs.at(id).spec.priority; };
  while (!front.empty()) {
    const int32_t priority = priority_of(front[0]);
    const auto end = std::find_if(front.begin(), front.end(),
                                  [&](uint64_t id) { return priority_of(id) != priority; });
    const auto count = static_cast<size_t>(end - front.begin());
    if (GrantOfEquals(state, front.first(count), worker, now)) return true;
    front = front.subspan(count);
  }
  return false;
}

bool GrantWarm(WorkState& state, JobRecord* job, WorkerRecord* worker, SteadyTime now) {
  for (const std::string& scene : worker->warm_scenes) {
    if (const auto warm = job->ready_by_scene.find(scene); warm != job->ready_by_scene.end()) {
      if (GrantFromFrames(state, job, warm->second, worker, now)) return true;
    }
    if (const std::optional<uint32_t> warm = job->pending.FirstOf(PackedDigest(scene))) {
      if (GrantByOpening(state, job, *warm, worker, now)) return true;
    }
  }
  return false;
}

}  // namespace sheaf::coordinator::scheduling
