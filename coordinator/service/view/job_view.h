// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobView, FrameView and what they consist of: a job and its frames as users see them, each with
// the description of its fields (view_field.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "common/film/error/rare_layers.h"
#include "common/scene/settings/render_settings.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/job/job_event.h"
#include "coordinator/service/view/view_field.h"

namespace sheaf::coordinator {

// Maximum number of tasks that are set aside and listed for one frame.
inline constexpr size_t kSetAsideShownMax = 16;

// "jobs/7/frames/12".
std::string FrameName(const std::string& job_id, int32_t frame_number);

// Progress of a frame or a job, and its cost.
struct ProgressView {
  uint64_t sample_count_done = 0;      // Pixel samples and light paths, merged and durable.
  uint64_t sample_count_total = 0;     // The expected total if a rule ends the frame.
  std::optional<double> relative_mse;  // Estimated.
  uint64_t nonfinite_count = 0;
  uint64_t ray_count = 0;
  double cpu_seconds = 0;                   // CPU time of workers for accepted results.
  double wall_seconds = 0;                  // Since the first lease, including refinements.
  std::optional<double> remaining_seconds;  // Takes the farm's other jobs into account.
  // The band that holds in 8 of 10 cases, and the time that would be left if no other job shared
  // the farm. Only for live jobs.
  std::optional<double> remaining_low_seconds, remaining_high_seconds, remaining_alone_seconds;
};
inline const char* ViewName(const ProgressView&) { return "Progress"; }
template <MaybeConst<ProgressView> View, typename Visitor>
void VisitFields(View& progress, const Visitor& visit) {
  visit(ViewField{"sample_count_done"}, progress.sample_count_done);
  visit(ViewField{"sample_count_total"}, progress.sample_count_total);
  visit(ViewField{"relative_mse"}, progress.relative_mse);
  visit(ViewField{"nonfinite_count"}, progress.nonfinite_count);
  visit(ViewField{"ray_count"}, progress.ray_count);
  visit(ViewField{"cpu_duration_seconds"}, progress.cpu_seconds);
  visit(ViewField{"wall_duration_seconds"}, progress.wall_seconds);
  visit(ViewField{"remaining_duration_seconds"}, progress.remaining_seconds);
  visit(ViewField{"remaining_duration_low_seconds"}, progress.remaining_low_seconds);
  visit(ViewField{"remaining_duration_high_seconds"}, progress.remaining_high_seconds);
  visit(ViewField{"remaining_duration_alone_seconds"}, progress.remaining_alone_seconds);
}

// A point of a frame's error curve: its state at the end of a round (sample_rounds.h), or in
// between for a frame without rounds.
struct RoundView {
  double relative_mse = 0;
  double relative_mse_upper = 0;      // Its upper confidence bound.
  double predicted_relative_mse = 0;  // For the next round; 0 in the last one.
  double prediction_ratio = 0;        // relative_mse over its prediction; 0 in the first round.
  uint64_t sample_count = 0;          // Camera samples so far; this and the next are sums.
  uint64_t ray_count = 0;
  double cpu_seconds = 0, wall_seconds = 0;
  uint64_t part_bytes = 0;
  double certified_relative_mse = 0;  // RoundRecord::certified_upper.
  uint64_t preview_version = 0;       // The version of RoundPreview(); 0: not kept.
};
inline const char* ViewName(const RoundView&) { return "Round"; }
template <MaybeConst<RoundView> View, typename Visitor>
void VisitFields(View& round, const Visitor& visit) {
  visit(ViewField{"relative_mse"}, round.relative_mse);
  visit(ViewField{"relative_mse_upper"}, round.relative_mse_upper);
  visit(ViewField{"predicted_relative_mse"}, round.predicted_relative_mse);
  visit(ViewField{"prediction_ratio"}, round.prediction_ratio);
  visit(ViewField{"sample_count"}, round.sample_count);
  visit(ViewField{"ray_count"}, round.ray_count);
  visit(ViewField{"cpu_duration_seconds"}, round.cpu_seconds);
  visit(ViewField{"wall_duration_seconds"}, round.wall_seconds);
  visit(ViewField{"part_bytes"}, round.part_bytes);
  visit(ViewField{"certified_relative_mse"}, round.certified_relative_mse);
  visit(ViewField{.name = "preview_version", .shown = ViewField::Shown::kOnlyHttp},
        round.preview_version);
}

// How often a worker failed a task with one class of failure; the worker is empty where it
// vanished.
struct TaskFailureView {
  std::string kind;  // As FailureKindName writes it.
  std::string worker;
  int32_t count = 0;
  std::string message;
};
TaskFailureView MakeView(const TaskFailure& failure);
inline const char* ViewName(const TaskFailureView&) { return "TaskFailure"; }
template <MaybeConst<TaskFailureView> View, typename Visitor>
void VisitFields(View& failure, const Visitor& visit) {
  visit(ViewField{"kind"}, failure.kind);
  visit(ViewField{"worker"}, failure.worker);
  visit(ViewField{"count"}, failure.count);
  visit(ViewField{"message"}, failure.message);
}

// A task that is set aside: it failed too often, or a user set it aside.
struct SetAsideView {
  uint32_t task = 0;  // The number of its tile, by which it can be retried.
  std::string why;
  std::vector<TaskFailureView> failures;  // None if a user set it aside.
};
inline const char* ViewName(const SetAsideView&) { return "SetAsideTask"; }
template <MaybeConst<SetAsideView> View, typename Visitor>
void VisitFields(View& task, const Visitor& visit) {
  visit(ViewField{"task"}, task.task);
  visit(ViewField{"why"}, task.why);
  visit(ViewField{"failures"}, task.failures);
}

struct FrameView {
  int32_t frame_number = 0;
  std::string scene_digest;       // Hex, of the manifest blob.
  uint64_t scene_size_bytes = 0;  // Size of the manifest blob.
  std::string frame_digest;       // Hex.
  FrameSettings settings;
  // A later version made the message, and the settings lack its techniques.
  bool has_unknown_techniques = false;
  StopRule stop;
  BlobDigest resumed;                     // The EXR that the frame resumes; empty if none.
  std::optional<StopReason> stop_reason;  // Known once complete, as are the next five.
  uint32_t tile_count = 0;
  uint32_t unreliable_tile_count = 0;         // Tiles with unreliable error estimates.
  std::vector<LayerCount> unreliable_layers;  // The causes, if the frame has layers.
  std::optional<double> flip;                 // At delivery.
  // Errors of a stereo frame, at delivery (eye_errors.h).
  std::optional<double> left_eye_relative_mse, right_eye_relative_mse, eye_difference_relative_mse;
  std::optional<double> one_sequence_gain;  // OneSequenceGain; for frames without a stop rule.
  // The proof of the bound of samples, or why the error has no certificate (SampleBound::reason).
  std::string certificate;
  std::vector<RoundView> rounds;  // Ascending; empty without rounds, and in ListJobs.
  bool is_training = false;       // Whether its guiding field is still to be trained, though begun.
  bool complete = false;          // Whether the EXR is delivered.
  std::string incomplete;         // Why it ended without an image; empty otherwise.
  // Says that it waits for another job's frame or for approval; or empty.
  std::string waiting_reason;
  // At most kSetAsideShownMax of set_aside_count; empty in ListJobs.
  std::vector<SetAsideView> set_aside;
  int32_t set_aside_count = 0;
  int32_t correction_count = 0;  // Deliveries with results later found false.
  std::string image_digest;      // Hex; empty until complete.
  std::string output_path;       // The delivered EXR; empty until complete. Users do not see it.
  uint64_t preview_version = 0;  // Increases whenever Preview() changes.
  ProgressView progress;
};
inline const char* ViewName(const FrameView&) { return "Frame"; }
// Its name is the job's and its number (FrameName). Its FrameTrouble is in the job's message.
template <MaybeConst<FrameView> View, typename Visitor>
void VisitFields(View& frame, const Visitor& visit) {
  using enum ViewField::Shown;
  visit(ViewField{.name = "frame_number", .in_message = "spec.frame_number"}, frame.frame_number);
  visit(ViewField{.name = "scene_digest", .in_message = "spec.scene.sha256_hex"},
        frame.scene_digest);
  visit(ViewField{.name = "scene_size_bytes",
                  .in_message = "spec.scene.size_bytes",
                  .shown = kOnlyMessages},
        frame.scene_size_bytes);
  visit(ViewField{"frame_digest"}, frame.frame_digest);
  visit(ViewField{.name = "settings",
                  .in_message = "spec.settings",
                  .settings = SettingField::Shown::kWithShape},
        frame.settings);
  visit(ViewField{.name = "resumed_image", .in_message = "spec.resumed_image"}, frame.resumed);
  visit(ViewField{.name = "stop", .in_message = "spec.stop"}, frame.stop);
  visit(ViewField{"stop_reason"}, frame.stop_reason);
  visit(ViewField{"rounds"}, frame.rounds);
  visit(ViewField{"tile_count"}, frame.tile_count);
  visit(ViewField{"unreliable_tile_count"}, frame.unreliable_tile_count);
  visit(ViewField{"unreliable_layers"}, frame.unreliable_layers);
  visit(ViewField{"flip"}, frame.flip);
  visit(ViewField{"left_eye_relative_mse"}, frame.left_eye_relative_mse);
  visit(ViewField{"right_eye_relative_mse"}, frame.right_eye_relative_mse);
  visit(ViewField{"eye_difference_relative_mse"}, frame.eye_difference_relative_mse);
  visit(ViewField{"certificate"}, frame.certificate);
  visit(ViewField{"correction_count"}, frame.correction_count);
  visit(ViewField{"one_sequence_gain"}, frame.one_sequence_gain);
  visit(ViewField{.name = "settings",
                  .shown = kInMessageElsewhere,
                  .settings = SettingField::Shown::kWithSettings},
        frame.settings);
  visit(ViewField{"training"}, frame.is_training);
  visit(ViewField{"complete"}, frame.complete);
  visit(ViewField{.name = "incomplete", .shown = kInMessageElsewhere}, frame.incomplete);
  visit(ViewField{"waiting_reason"}, frame.waiting_reason);
  visit(ViewField{.name = "set_aside_tasks", .shown = kInMessageElsewhere}, frame.set_aside);
  visit(ViewField{.name = "set_aside_task_count", .shown = kInMessageElsewhere},
        frame.set_aside_count);
  visit(ViewField{"image_digest"}, frame.image_digest);
  visit(ViewField{.name = "preview_version", .shown = kOnlyHttp}, frame.preview_version);
  visit(ViewField{"progress"}, frame.progress);
}

// A frame with an image to show.
struct PreviewFrame {
  std::string name;  // FrameName.
  uint64_t preview_version = 0;
  bool complete = false;
};
inline const char* ViewName(const PreviewFrame&) { return "PreviewFrame"; }
template <MaybeConst<PreviewFrame> View, typename Visitor>
void VisitFields(View& frame, const Visitor& visit) {
  visit(ViewField{"name"}, frame.name);
  visit(ViewField{"preview_version"}, frame.preview_version);
  visit(ViewField{"complete"}, frame.complete);
}

// The states of the proto Job.State, with their numbers; names without its prefix.
enum class JobState { kQueued = 1, kRunning, kSucceeded, kFailed, kCancelled, kPaused };
// Returns "queued", "running", "succeeded", "failed", "cancelled" or "paused".
const char* JobStateName(JobState state);
bool HasEnded(JobState state);

// A job that another one waits for.
struct DependencyView {
  std::string job_id;
  bool by_frame = false;  // Frame n waits for its frame n.
  std::string state;      // "done", "released", "waits", "has failed" and the like, for users.
};
inline const char* ViewName(const DependencyView&) { return "Dependency"; }
template <MaybeConst<DependencyView> View, typename Visitor>
void VisitFields(View& dependency, const Visitor& visit) {
  visit(ViewField{.name = "job_name", .prefix = "jobs/"}, dependency.job_id);
  visit(ViewField{"by_frame"}, dependency.by_frame);
  visit(ViewField{"state"}, dependency.state);
}

struct JobView {
  std::string job_id;  // The resource name is "jobs/" + job_id.
  bool pilot = false;  // Rendered for a quote.
  std::string title;
  std::string owner;  // The user's name; "local" without certificates.
  std::string show;
  Requirements requirements;
  JobState state = JobState::kQueued;
  int32_t priority = 0;
  std::string numeric_profile;
  Partition partition;
  std::string failure;         // Reason for the failure; empty otherwise.
  std::string waiting_reason;  // Why the job makes no progress; empty otherwise.
  std::string warning;         // About its images, for users; mostly empty.
  int64_t failure_count = 0;   // Number of failed leases.
  bool pinned = false;         // Its stored data is not removed.
  // When its parts were removed to keep the disk free; none: they were not.
  std::optional<absl::Time> parts_removed_time;
  absl::Time create_time;
  std::optional<absl::Time> end_time;  // None while it has not ended.
  int32_t frame_count = 0;
  int32_t frame_complete_count = 0;
  int32_t frame_incomplete_count = 0;
  int32_t training_frame_count = 0;
  int32_t unapproved_frame_count = 0;  // Delivered after a first pass, and wait for approval.
  std::vector<DependencyView> dependencies;
  std::optional<absl::Time> deadline_time;
  std::optional<Estimate> deadline_cpu_seconds;  // CPU time by the job's quote.
  bool held = false;  // Nothing of it may be leased: it is paused, or waits for jobs or users.
  std::vector<EffectCost> effect_costs;  // Empty unless measured, and in ListJobs.
  std::string command;                   // That submitted it; empty in ListJobs.
  ProgressView progress;                 // Sums over the frames.
  // The frame with most activity: the first one that is started but not complete, or else the last
  // complete one. None while no frame has an image.
  std::optional<PreviewFrame> preview_frame;
  std::vector<FrameView> frames;  // Ascending by number; empty in ListJobs.
};
inline const char* ViewName(const JobView&) { return "Job"; }
// Without its effect_costs and frames, which lists of jobs leave out.
template <MaybeConst<JobView> View, typename Visitor>
void VisitFields(View& job, const Visitor& visit) {
  using enum ViewField::Shown;
  visit(ViewField{.name = "name", .prefix = "jobs/"}, job.job_id);
  visit(ViewField{"title"}, job.title);
  visit(ViewField{"pilot"}, job.pilot);
  visit(ViewField{"state"}, job.state);
  visit(ViewField{"owner"}, job.owner);
  visit(ViewField{"show"}, job.show);
  auto& required = job.requirements;
  visit(ViewField{.name = "pool", .in_message = "requirements.pool"}, required.pool);
  visit(ViewField{.name = "required_tags", .in_message = "requirements.tags"}, required.tags);
  visit(ViewField{.name = "memory_min_bytes",
                  .in_message = "requirements.memory_min_bytes",
                  .null_if_empty = true},
        required.memory_min_bytes);
  visit(ViewField{.name = "memory_expected_bytes",
                  .in_message = "requirements.memory_expected_bytes",
                  .null_if_empty = true},
        required.memory_expected_bytes);
  visit(ViewField{"priority"}, job.priority);
  visit(ViewField{"numeric_profile"}, job.numeric_profile);
  visit(ViewField{.name = "partition", .shown = kOnlyMessages}, job.partition);
  visit(ViewField{"failure"}, job.failure);
  visit(ViewField{"waiting_reason"}, job.waiting_reason);
  visit(ViewField{"warning"}, job.warning);
  visit(ViewField{.name = "failure_count", .shown = kOnlyHttp}, job.failure_count);
  visit(ViewField{"pinned"}, job.pinned);
  visit(ViewField{"parts_removed_time"}, job.parts_removed_time);
  visit(ViewField{"create_time"}, job.create_time);
  visit(ViewField{"end_time"}, job.end_time);
  visit(ViewField{.name = "frame_count", .shown = kOnlyHttp}, job.frame_count);
  visit(ViewField{.name = "frame_complete_count", .shown = kOnlyHttp}, job.frame_complete_count);
  visit(ViewField{"incomplete_frame_count"}, job.frame_incomplete_count);
  visit(ViewField{"training_frame_count"}, job.training_frame_count);
  visit(ViewField{"unapproved_frame_count"}, job.unapproved_frame_count);
  visit(ViewField{"dependencies"}, job.dependencies);
  visit(ViewField{.name = "deadline_time", .in_message = "deadline.time"}, job.deadline_time);
  visit(ViewField{.name = "deadline_cpu_seconds",
                  .in_message = "deadline.cpu_seconds",
                  .shown = kOnlyMessages},
        job.deadline_cpu_seconds);
  visit(ViewField{"held"}, job.held);
  visit(ViewField{"command"}, job.command);
  visit(ViewField{.name = "preview_frame", .shown = kOnlyHttp}, job.preview_frame);
  visit(ViewField{"progress"}, job.progress);
}
// Updates job->preview_frame. Call for all frames in ascending order.
void NotePreviewFrame(const FrameView& frame, JobView* job);

inline const char* ViewName(const JobEvent&) { return "JobEvent"; }
template <MaybeConst<JobEvent> View, typename Visitor>
void VisitFields(View& event, const Visitor& visit) {
  visit(ViewField{"time"}, event.time);
  visit(ViewField{"what"}, event.what);
  visit(ViewField{"who"}, event.who);
  visit(ViewField{"frame_number"}, event.frame_number);
  visit(ViewField{"text"}, event.text);
}

// A failed lease of a job.
struct FailureView {
  FailureRecord failure;
  std::string command;  // The command that renders the tile again on one machine.
};
inline const char* ViewName(const FailureView&) { return "Failure"; }
template <MaybeConst<FailureView> View, typename Visitor>
void VisitFields(View& view, const Visitor& visit) {
  auto& failure = view.failure;
  visit(ViewField{"frame_number"}, failure.frame_number);
  visit(ViewField{"tile"}, failure.tile);
  visit(ViewField{"task"}, failure.task_kind);
  visit(ViewField{"first_sample"}, failure.block.first);
  visit(ViewField{"sample_count"}, failure.block.count);
  visit(ViewField{.name = "worker", .prefix = "workers/"}, failure.worker_id);
  visit(ViewField{"kind"}, failure.kind);
  visit(ViewField{"message"}, failure.message);
  visit(ViewField{"time"}, failure.time);
  visit(ViewField{"command"}, view.command);
}

}  // namespace sheaf::coordinator
