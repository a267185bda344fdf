// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/farm_view.h"

#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {

std::string FrameName(const std::string& job_id, int32_t frame_number) {
  return absl::StrCat("jobs/", job_id, "/frames/", frame_number);
}

TaskFailureView MakeView(const TaskFailure& failure) {
  return {FailureKindName(failure.kind), failure.worker_id, failure.count, failure.words};
}

const char* JobStateName(JobState state) {
  switch (state) {
    case JobState::kQueued:
      return "queued";
    case JobState::kRunning:
      return "running";
    case JobState::kSucceeded:
      return "succeeded";
    case JobState::kFailed:
      return "failed";
    case JobState::kCancelled:
      return "cancelled";
    case JobState::kPaused:
      return "paused";
  }
  return "unknown";
}

bool HasEnded(JobState state) {
  return state == JobState::kSucceeded || state == JobState::kFailed ||
         state == JobState::kCancelled;
}

void NotePreviewFrame(const FrameView& frame, JobView* job) {
  std::optional<PreviewFrame>& preview_frame = job->preview_frame;
  if (frame.preview_version == 0 || (preview_frame && !preview_frame->complete)) return;
  preview_frame = {FrameName(job->job_id, frame.frame_number), frame.preview_version,
                   frame.complete};
}

const char* LeasePhaseName(LeasePhase phase) {
  switch (phase) {
    case LeasePhase::kQueued:
      return "queued";
    case LeasePhase::kLoading:
      return "loading";
    case LeasePhase::kRendering:
      return "rendering";
    case LeasePhase::kUploading:
      return "uploading";
  }
  return "unknown";
}

const char* WorkerStateName(WorkerState state) {
  switch (state) {
    case WorkerState::kIdle:
      return "idle";
    case WorkerState::kBusy:
      return "busy";
    case WorkerState::kDraining:
      return "draining";
    case WorkerState::kLost:
      return "lost";
    case WorkerState::kQuarantined:
      return "quarantined";
    case WorkerState::kStopped:
      return "stopped";
    case WorkerState::kSick:
      return "sick";
  }
  return "unknown";
}

}  // namespace sheaf::coordinator
