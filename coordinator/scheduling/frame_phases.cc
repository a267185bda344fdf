// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/frame_phases.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/film/frame_image.h"
#include "coordinator/core/job/cell_grid.h"
#include "coordinator/core/job/job_approval.h"
#include "coordinator/scheduling/check_leases.h"
#include "coordinator/scheduling/lease_failures.h"
#include "coordinator/scheduling/placed_grants.h"
#include "coordinator/scheduling/set_aside.h"
#include "coordinator/scheduling/work_holds.h"

namespace sheaf::coordinator::scheduling {
namespace {

// The size of an open frame: its pixels, in units of an image without outputs.
int64_t OpenPixelsOf(const FrameSettings& settings) {
  const auto channel_count = static_cast<int64_t>(ImageChannelCount(settings.outputs));
  constexpr auto kUnit = static_cast<int64_t>(kImageChannelCountMin);
  // With light passes: the images of the camera and of the light paths, and their sum.
  const int64_t image_count = HasLightPasses(settings) ? 3 : 1;
  return image_count * settings.window.PixelCount() * ((channel_count + kUnit - 1) / kUnit);
}

}  // namespace

const FrameRecord* FindFrame(const WorkState& state, const FrameId& id) {
  const auto job = state.jobs.find(id.job_id);
  if (job == state.jobs.end()) return nullptr;
  const std::optional<uint32_t> index = job->second.FindIndex(id.frame_number);
  return index ? &job->second.frames[*index] : nullptr;
}

FrameRecord& Frame(WorkState& state, const FrameId& id) {
  JobRecord& job = state.jobs.at(id.job_id);
  return job.frames[job.IndexOf(id.frame_number)];
}

void UpdateReadyJob(WorkState& state, JobRecord* job) {
  if (job->phase != JobPhase::kLive) return;
  const bool has_work = !job->pending.empty() || !job->ready.empty();
  state.sharing.order.SetReady(job->spec.job_id, has_work && job->MayLease());
}

void UpdateReady(WorkState& state, JobRecord* job, uint32_t index) {
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
    state.doubts.stuck_frames.insert({job->spec.job_id, frame.number()});
  }
  NoteWork(state, job, frame.packed.scene());
  UpdateReadyJob(state, job);
}

bool MayOpen(const WorkState& state, const FrameRecord& frame) {
  return state.open_pixels == 0 ||
         state.open_pixels + OpenPixelsOf(frame.settings()) <= state.limits.open_pixels_max;
}

void Open(WorkState& state, JobRecord* job, uint32_t index) {
  FrameRecord& frame = job->frames[index];
  SHEAF_CHECK(frame.phase == FrameRecord::Phase::kPending);
  const FrameSettings& settings = frame.settings();
  frame.tasks = std::make_unique<FrameTasks>(CellGrid(frame.Spec(), job->spec.partition),
                                             FirstRoundSamplesOf(frame), settings.lattice,
                                             PathsPerLightPass(settings));
  frame.phase = FrameRecord::Phase::kOpen;
  state.open_pixels += OpenPixelsOf(settings);
  if (frame.stop().IsActive()) state.round_frames.insert({job->spec.job_id, frame.number()});
  UpdateReady(state, job, index);
}

void Close(WorkState& state, JobRecord* job, uint32_t index, FrameRecord::Phase phase) {
  FrameRecord& frame = job->frames[index];
  if (frame.tasks != nullptr) state.open_pixels -= OpenPixelsOf(frame.settings());
  frame.tasks.reset();
  frame.phase = phase;
  const FrameId id{job->spec.job_id, frame.number()};
  if (phase == FrameRecord::Phase::kDelivered) ForgetTroubles(state, &frame);
  DropChecks(state, id);
  state.doubts.frames.erase(id);
  state.round_frames.erase(id);
  state.live_frames.Erase(frame.packed.frame_digest(), id);
  UpdateReady(state, job, index);
  if (phase != FrameRecord::Phase::kDelivered) return;
  if (IsUnapproved(job->spec, id.frame_number)) ++job->unapproved_count;
  JudgeDependentsOn(state, id);
}

void EndJob(WorkState& state, uint64_t job_id, JobPhase phase, const std::string& failure) {
  JobRecord& job = state.jobs.at(job_id);
  if (job.phase != JobPhase::kLive) return;
  for (const uint64_t lease_id : state.leases.OfJob(job_id)) {
    ++state.counters.leases_cancelled;
    DropLease(state, lease_id, /*put_back=*/true);
  }
  for (uint32_t i = 0; i < job.frames.size(); ++i) {
    FrameRecord& frame = job.frames[i];
    const bool has_ended = frame.phase == FrameRecord::Phase::kDelivered ||
                           frame.phase == FrameRecord::Phase::kIncomplete;
    if (!has_ended) Close(state, &job, i, FrameRecord::Phase::kClosed);
    // Only a failed job can be retried.
    if (phase != JobPhase::kFailed) frame.failures.clear();
  }
  job.phase = phase;
  job.failure = failure;
  job.paused_time = SteadyTime::InfiniteFuture();
  state.sharing.order.RemoveJob(job_id);
  state.sharing.groups.Release(job.requirement_group);
  --state.live_job_count;
  const auto of_owner = state.owner_work.find(job.spec.owner);
  of_owner->second -= job.work;
  if (of_owner->second == OwnerWork()) state.owner_work.erase(of_owner);
  state.news.ended_jobs.push_back(job_id);
  state.dependents.Erase(job.spec);
  JudgeDependents(state, job_id);
}

}  // namespace sheaf::coordinator::scheduling
