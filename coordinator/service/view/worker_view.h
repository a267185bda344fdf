// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkerView: a worker as users see it, with the description of its fields (view_field.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "coordinator/core/job/job.h"
#include "coordinator/service/view/job_view.h"
#include "coordinator/service/view/view_field.h"

namespace sheaf::coordinator {

// Maximum number of leases and of scenes that are listed for one worker.
inline constexpr size_t kWorkerLeasesShownMax = 4;
inline constexpr size_t kWorkerScenesShownMax = 8;

// The states of the proto Worker.State, with their numbers.
enum class WorkerState { kIdle = 1, kBusy, kDraining, kLost, kQuarantined, kStopped, kSick };
inline constexpr WorkerState kWorkerStates[] = {
    WorkerState::kIdle,        WorkerState::kBusy,    WorkerState::kDraining, WorkerState::kLost,
    WorkerState::kQuarantined, WorkerState::kStopped, WorkerState::kSick};
// Returns "idle", "busy", "draining", "lost", "quarantined", "stopped" or "sick".
const char* WorkerStateName(WorkerState state);

// A lease that a worker holds.
struct LeaseView {
  FrameId frame;
  PixelRect tile;
  SampleBlock block;
  LeasePhase phase = LeasePhase::kQueued;
  absl::Time grant_time;
  TaskKind kind = TaskKind::kCamera;
};
// Returns "queued", "loading", "rendering" or "uploading".
const char* LeasePhaseName(LeasePhase phase);
inline const char* ViewName(const LeaseView&) { return "Lease"; }
template <MaybeConst<LeaseView> View, typename Visitor>
void VisitFields(View& lease, const Visitor& visit) {
  visit(ViewField{"frame_name"},
        FrameName(absl::StrCat(lease.frame.job_id), lease.frame.frame_number));
  visit(ViewField{"pilot"}, IsPilot(lease.frame.job_id));
  visit(ViewField{"tile"}, lease.tile);
  visit(ViewField{"task"}, lease.kind);
  visit(ViewField{"first_sample"}, lease.block.first);
  visit(ViewField{"sample_count"}, lease.block.count);
  visit(ViewField{"phase"}, lease.phase);
  visit(ViewField{"grant_time"}, lease.grant_time);
}

struct WorkerView {
  std::string worker_id;
  std::string identity;  // Its certificate's common name, or its id.
  std::string host;
  WorkerState state = WorkerState::kIdle;
  int32_t thread_count = 0;
  WorkerTraits traits;
  std::string numeric_profile;
  int32_t lease_count = 0;
  uint64_t result_count = 0;
  double samples_per_second = 0;
  uint64_t lease_granted_count = 0;
  uint64_t lease_cold_count = 0;  // Those of scenes that it had to load first.
  absl::Time last_seen_time;
  std::string reason;  // Reason for the quarantine or sickness; empty otherwise.
  // An operator has drained it; it exits when it holds no lease.
  bool drained = false, exits = false;
  // At most kWorkerLeasesShownMax, in the order in which they are rendered.
  std::vector<LeaseView> leases;
  // File names of scenes in memory, at most kWorkerScenesShownMax of warm_scene_count.
  std::vector<std::string> warm_scenes;
  int32_t warm_scene_count = 0;
  std::optional<uint64_t> scene_memory_bytes;
};
inline const char* ViewName(const WorkerView&) { return "Worker"; }
template <MaybeConst<WorkerView> View, typename Visitor>
void VisitFields(View& worker, const Visitor& visit) {
  using enum ViewField::Shown;
  visit(ViewField{.name = "name", .prefix = "workers/"}, worker.worker_id);
  visit(ViewField{"identity"}, worker.identity);
  visit(ViewField{"host"}, worker.host);
  visit(ViewField{"state"}, worker.state);
  visit(ViewField{"thread_count"}, worker.thread_count);
  visit(ViewField{"pool"}, worker.traits.pool);
  visit(ViewField{"tags"}, worker.traits.tags);
  visit(ViewField{.name = "memory_bytes", .null_if_empty = true}, worker.traits.memory_bytes);
  visit(ViewField{"numeric_profile"}, worker.numeric_profile);
  visit(ViewField{"lease_count"}, worker.lease_count);
  visit(ViewField{.name = "leases", .shown = kOnlyHttp}, worker.leases);
  visit(ViewField{.name = "warm_scene_count", .shown = kOnlyHttp}, worker.warm_scene_count);
  visit(ViewField{.name = "warm_scenes", .shown = kOnlyHttp}, worker.warm_scenes);
  visit(ViewField{.name = "scene_memory_bytes", .shown = kOnlyHttp}, worker.scene_memory_bytes);
  visit(ViewField{"result_count"}, worker.result_count);
  visit(ViewField{"samples_per_second"}, worker.samples_per_second);
  visit(ViewField{"lease_granted_count"}, worker.lease_granted_count);
  visit(ViewField{"lease_cold_count"}, worker.lease_cold_count);
  visit(ViewField{"last_seen_time"}, worker.last_seen_time);
  visit(ViewField{"reason"}, worker.reason);
  visit(ViewField{"drained"}, worker.drained);
  visit(ViewField{"then_exit"}, worker.exits);
}

}  // namespace sheaf::coordinator
