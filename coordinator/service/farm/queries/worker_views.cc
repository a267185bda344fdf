// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/queries/worker_views.h"

#include <algorithm>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "coordinator/core/job/render_command.h"
#include "coordinator/service/view/enum_name.h"

namespace sheaf::coordinator {

WorkerState StateOf(const WorkerRecord& worker) {
  if (worker.Quarantined()) return WorkerState::kQuarantined;
  if (worker.lost) return WorkerState::kLost;
  if (worker.Stopped()) return WorkerState::kStopped;
  if (worker.Draining()) return WorkerState::kDraining;
  if (worker.Sick()) return WorkerState::kSick;
  return worker.leases.empty() ? WorkerState::kIdle : WorkerState::kBusy;
}

WorkerView WorkerViews::ViewOf(const WorkerRecord& worker) const {
  const SteadyTime now = SteadyTime::Now();
  const absl::Time wall_now = absl::Now();
  const auto stamp = [&](SteadyTime time) { return wall_now - (now - time); };
  WorkerView view;
  view.worker_id = worker.worker_id;
  view.identity = worker.identity;
  view.host = worker.host;
  view.state = StateOf(worker);
  view.thread_count = worker.thread_count;
  view.traits = worker.traits;
  view.numeric_profile = worker.numeric_profile;
  view.lease_count = static_cast<int32_t>(worker.leases.size());
  view.result_count = worker.result_count;
  view.lease_granted_count = worker.lease_granted_count;
  view.lease_cold_count = worker.lease_cold_count;
  view.samples_per_second = worker.SamplesPerThreadSecond() * worker.thread_count;
  view.last_seen_time = stamp(worker.last_seen_time);
  view.reason = worker.Quarantined() ? worker.quarantine_reason : worker.sick_reason;
  view.drained = worker.drained;
  view.exits = worker.drained_then_exit;
  for (const uint64_t id : worker.leases) {
    const Lease& lease = *tables_.scheduler.leases().Find(id);
    view.leases.push_back({lease.frame, lease.tile_rect, lease.task.block, lease.phase,
                           stamp(lease.grant_time), lease.kind});
  }
  std::stable_sort(
      view.leases.begin(), view.leases.end(), [](const LeaseView& a, const LeaseView& b) {
        return (a.phase == LeasePhase::kRendering) > (b.phase == LeasePhase::kRendering);
      });
  view.leases.resize(std::min(view.leases.size(), kWorkerLeasesShownMax));
  if (worker.lost || worker.Stopped()) return view;  // Its memory is gone.
  view.warm_scene_count = static_cast<int32_t>(worker.warm_scenes.size());
  for (const std::string& scene : worker.warm_scenes) {
    if (view.warm_scenes.size() >= kWorkerScenesShownMax) break;
    view.warm_scenes.push_back(scene);
  }
  if (worker.scene_memory_bytes > 0) view.scene_memory_bytes = worker.scene_memory_bytes;
  return view;
}

std::vector<WorkerView> WorkerViews::List() const {
  std::vector<WorkerView> views;
  {
    const MutexLock lock(&tables_.mutex);
    for (const auto& [id, worker] : tables_.scheduler.workers().workers())
      views.push_back(ViewOf(worker));
  }
  // Names may have to be read from the disk.
  for (WorkerView& view : views) {
    for (std::string& scene : view.warm_scenes) scene = names_.Find(scene);
  }
  return views;
}

absl::StatusOr<std::vector<FailureView>> WorkerViews::ListFailures(
    const std::string& job_id) const {
  struct Found {
    FailureRecord failure;
    FrameSettings settings;
    std::string scene;
  };
  std::vector<Found> found;
  {
    uint64_t id = 0;
    const bool is_number = absl::SimpleAtoi(job_id, &id);
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> job = tables_.FindJob(is_number ? id : 0);
    if (!job.ok()) return job.status();
    for (const FailureRecord& failure : (*job)->failures.last) {
      const FrameSpec spec = tables_.scheduler.FindFrame({id, failure.frame_number})->Spec();
      found.push_back({failure, spec.settings, spec.scene.sha256_hex});
    }
  }
  std::reverse(found.begin(), found.end());
  std::vector<FailureView> views;
  for (Found& one : found) {
    const FailureRecord& failure = one.failure;
    std::string command =
        RenderCommand(names_.Find(one.scene), one.settings, failure.tile, failure.block.End());
    views.push_back({std::move(one.failure), std::move(command)});
  }
  return views;
}

absl::StatusOr<std::vector<JobEvent>> WorkerViews::ListEvents(const std::string& job_id) const {
  uint64_t id = 0;
  const bool is_number = absl::SimpleAtoi(job_id, &id);
  std::vector<JobEvent> events(1);
  {
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> job = tables_.FindJob(is_number ? id : 0);
    if (!job.ok()) return job.status();
    events[0] = {id, tables_.accounts.at(id).create_time, "submit", (*job)->spec.owner};
    for (const FailureRecord& failure : (*job)->failures.last) {
      const PixelRect& tile = failure.tile;
      events.push_back({id, failure.time, "failure", absl::StrCat("workers/", failure.worker_id),
                        failure.frame_number,
                        absl::StrCat("tile ", tile.x0, ",", tile.y0, ",", tile.x1, ",", tile.y1,
                                     ", ", EnumName(failure.kind), ": ", failure.message)});
    }
  }
  absl::StatusOr<std::vector<JobEvent>> noted = journal_.Read(id);
  if (!noted.ok()) return noted.status();
  events.insert(events.end(), noted->begin(), noted->end());
  std::stable_sort(events.begin() + 1, events.end(),
                   [](const JobEvent& a, const JobEvent& b) { return a.time < b.time; });
  return events;
}

}  // namespace sheaf::coordinator
