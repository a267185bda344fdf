// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/loading_failures.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "coordinator/scheduling/frame_phases.h"
#include "coordinator/scheduling/lease_failures.h"
#include "coordinator/scheduling/lease_grants.h"

namespace sheaf::coordinator::scheduling {
namespace {

void JudgeLoadingLosses(WorkState& state, const FrameId& id) {
  const JobRecord& job = state.jobs.at(id.job_id);
  const LoadingLosses& frame_losses = job.frame_loading_losses.at(id.frame_number);
  const bool of_frame = frame_losses.count() >= state.limits.loading_losses_max;
  const bool of_job = job.loading_losses.count() >= state.limits.job_loading_losses_max;
  if (!of_frame && !of_job) return;
  const absl::btree_set<std::string>& workers =
      of_frame ? frame_losses.workers() : job.loading_losses.workers();
  std::set<std::string> identities;
  for (const std::string& worker_id : workers) {
    const auto worker = state.workers.workers().find(worker_id);
    if (worker != state.workers.workers().end()) identities.insert(worker->second.identity);
  }
  if (!AreBelieved(state, job.spec.numeric_profile, identities)) return;
  const std::string text = absl::StrCat(
      "frame ", id.frame_number, ": ", workers.size(), " workers disappeared one after the other ",
      "while they loaded ", of_frame ? "its scene" : "scenes of this job",
      ", and no worker has loaded it: ", absl::StrJoin(workers, ", "),
      "; the scene may need more memory than they have (sheaf plan estimates it); make it smaller, "
      "or start workers with more memory and submit it again (scene digest ",
      Frame(state, id).packed.scene().Hex(), ")");
  EndJob(state, id.job_id, JobPhase::kFailed, text);
}

}  // namespace

void NoteLoaded(WorkState& state, const FrameId& id) {
  FrameRecord& frame = Frame(state, id);
  if (frame.loaded) return;
  frame.loaded = true;
  JobRecord& job = state.jobs.at(id.job_id);
  job.frame_loading_losses.erase(id.frame_number);
  job.loading_losses.Clear();
}

void CountLoadingLoss(WorkState& state, const Lease& lease) {
  if (Frame(state, lease.frame).loaded) return;
  JobRecord& job = state.jobs.at(lease.frame.job_id);
  // A live worker reports at least this often.
  const WorkerRecord* worker = state.workers.Find(lease.worker_id);
  const SteadyTime gone_time =
      (worker != nullptr ? worker->last_seen_time : lease.grant_time) + BusyInterval(state);
  job.frame_loading_losses[lease.frame.frame_number].Add(lease.worker_id, lease.grant_time,
                                                         gone_time);
  job.loading_losses.Add(lease.worker_id, lease.grant_time, gone_time);
  JudgeLoadingLosses(state, lease.frame);
}

void RestoreLoadingLosses(WorkState& state, JobRecord* job) {
  for (const FailureRecord& failure : job->failures.last) {
    if (failure.kind != FailureKind::kLoading) continue;
    if (!job->FindIndex(failure.frame_number).has_value()) continue;
    LoadingLosses& frame_losses = job->frame_loading_losses[failure.frame_number];
    // The time of its lease's grant is not stored; being later than the previous loss must suffice.
    // A restored loss does not end a job.
    const SteadyTime lost_time = SteadyTime() + (failure.time - absl::UnixEpoch());
    const SteadyTime gone_time = lost_time + BusyInterval(state);
    if (frame_losses.count() + 1 < state.limits.loading_losses_max) {
      frame_losses.Add(failure.worker_id, lost_time, gone_time);
    }
    if (job->loading_losses.count() + 1 < state.limits.job_loading_losses_max) {
      job->loading_losses.Add(failure.worker_id, lost_time, gone_time);
    }
  }
  for (auto& [number, losses] : job->frame_loading_losses) losses.ForgetTime();
  job->loading_losses.ForgetTime();
}

}  // namespace sheaf::coordinator::scheduling
