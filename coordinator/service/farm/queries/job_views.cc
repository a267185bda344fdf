// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/queries/job_views.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <utility>

#include "absl/hash/hash.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/scene/settings/sample_bound.h"
#include "coordinator/core/job/job_approval.h"
#include "coordinator/service/farm/queries/frame_previews.h"

namespace sheaf::coordinator {
namespace {

double Seconds(absl::Duration duration) { return absl::ToDoubleSeconds(duration); }

// None for 0, which records have while a value is unknown.
std::optional<double> AboveZero(double value) {
  return value > 0 ? std::optional<double>(value) : std::nullopt;
}

// None for InfiniteFuture, which records have for what has not happened.
std::optional<absl::Time> KnownTime(absl::Time time) {
  return time == absl::InfiniteFuture() ? std::nullopt : std::optional<absl::Time>(time);
}

// Adds a frame's progress to its job's; relative_mse is weighted by samples and divided at the end.
void AddProgress(const ProgressView& frame, ProgressView* sum) {
  sum->sample_count_done += frame.sample_count_done;
  sum->sample_count_total += frame.sample_count_total;
  sum->relative_mse = sum->relative_mse.value_or(0) +
                      frame.relative_mse.value_or(0) * static_cast<double>(frame.sample_count_done);
  sum->nonfinite_count += frame.nonfinite_count;
  sum->ray_count += frame.ray_count;
  sum->cpu_seconds += frame.cpu_seconds;
}

JobState StateOf(const JobRecord& job, bool begun) {
  if (job.Paused()) return JobState::kPaused;
  switch (job.phase) {
    case JobPhase::kSucceeded:
      return JobState::kSucceeded;
    case JobPhase::kFailed:
      return JobState::kFailed;
    case JobPhase::kCancelled:
      return JobState::kCancelled;
    case JobPhase::kLive:
      break;
  }
  return begun ? JobState::kRunning : JobState::kQueued;
}

void AddSetAside(const FrameRecord& frame, FrameView* view) {
  for (const auto& [id, failures] : frame.failures) {
    const TaskTrouble& trouble = failures.trouble;
    if (trouble.set_aside.empty() || trouble.OfFrame()) continue;
    if (view->set_aside.size() < kSetAsideShownMax) {
      SetAsideView& task =
          view->set_aside.emplace_back(SetAsideView{id.tile, trouble.set_aside, {}});
      for (const TaskFailure& failure : trouble.failures)
        task.failures.push_back(MakeView(failure));
    }
    ++view->set_aside_count;
  }
}

std::vector<RoundView> ViewsOf(const FrameId& frame, const std::vector<RoundRecord>& rounds,
                               const RoundPreviews& previews) {
  std::vector<RoundView> views;
  views.reserve(rounds.size());
  for (const RoundRecord& round : rounds) {
    const double foretold = views.empty() ? 0 : views.back().predicted_relative_mse;
    views.push_back({round.relative_mse, round.relative_mse_upper, round.predicted_relative_mse,
                     foretold > 0 ? round.relative_mse / foretold : 0, round.sample_count,
                     round.cost.ray_count, Seconds(round.cost.cpu_duration),
                     Seconds(round.wall_duration), round.cost.part_bytes, round.certified_upper,
                     previews.VersionOf(frame, round.round)});
  }
  return views;
}

// Never 0, which means a frame not yet seen. view: without its spec.
size_t MarkOf(const FrameRecord& frame, const FrameView& view, size_t round_count) {
  const ProgressView& progress = view.progress;
  const size_t mark =
      absl::HashOf(frame.phase, frame.failures.size(), frame.refused_by.size(), view.is_training,
                   view.waiting_reason, view.correction_count, view.preview_version,
                   view.image_digest, round_count, progress.sample_count_done,
                   progress.sample_count_total, progress.nonfinite_count, progress.ray_count,
                   progress.cpu_seconds, progress.relative_mse.value_or(0));
  return mark == 0 ? 1 : mark;
}

absl::Status NoSuchJob(const std::string& job_id) {
  return absl::NotFoundError(absl::StrCat("jobs/", job_id, ": there is no such job"));
}

}  // namespace

std::vector<JobView> JobViews::List() const {
  const MutexLock lock(&tables_.mutex);
  return ListBelow(kFirstPilotId);
}

std::vector<JobView> JobViews::ListWithPilots() const {
  std::vector<JobView> views;
  {
    const MutexLock lock(&tables_.mutex);
    views = ListBelow(UINT64_MAX);
  }
  std::stable_sort(views.begin(), views.end(), [](const JobView& a, const JobView& b) {
    return a.create_time > b.create_time;
  });
  return views;
}

std::vector<JobView> JobViews::ListBelow(uint64_t job_id) const {
  const SteadyTime now = SteadyTime::Now();
  std::vector<JobView> views;
  const std::map<uint64_t, JobRecord>& jobs = tables_.scheduler.jobs();
  for (auto it = std::make_reverse_iterator(jobs.lower_bound(job_id)); it != jobs.rend(); ++it) {
    views.push_back(ViewOf(it->second, /*with_frames=*/false, /*marks=*/nullptr, now));
  }
  return views;
}

absl::StatusOr<JobView> JobViews::Find(const std::string& job_id, bool with_frames) const {
  uint64_t id = 0;
  if (!absl::SimpleAtoi(job_id, &id)) return NoSuchJob(job_id);
  const MutexLock lock(&tables_.mutex);
  const auto job = tables_.scheduler.jobs().find(id);
  if (job == tables_.scheduler.jobs().end()) return NoSuchJob(job_id);
  return ViewOf(job->second, with_frames, /*marks=*/nullptr, SteadyTime::Now());
}

absl::StatusOr<JobView> JobViews::FindChanges(const std::string& job_id, FrameMarks* marks) const {
  uint64_t id = 0;
  if (!absl::SimpleAtoi(job_id, &id)) return NoSuchJob(job_id);
  const MutexLock lock(&tables_.mutex);
  const auto job = tables_.scheduler.jobs().find(id);
  if (job == tables_.scheduler.jobs().end()) return NoSuchJob(job_id);
  return ViewOf(job->second, /*with_frames=*/true, marks, SteadyTime::Now());
}

bool JobViews::IsLive(const std::string& job_id) const {
  uint64_t id = 0;
  if (!absl::SimpleAtoi(job_id, &id)) return false;
  const MutexLock lock(&tables_.mutex);
  const auto job = tables_.scheduler.jobs().find(id);
  return job != tables_.scheduler.jobs().end() && job->second.phase == JobPhase::kLive;
}

JobView JobViews::ViewOf(const JobRecord& job, bool with_frames, FrameMarks* marks,
                         SteadyTime now) const {
  const JobAccount& account = tables_.accounts.at(job.spec.job_id);
  JobView view;
  view.job_id = absl::StrCat(job.spec.job_id);
  view.pilot = IsPilot(job.spec.job_id);
  view.title = job.spec.title;
  view.owner = job.spec.owner;
  view.show = job.spec.show;
  view.requirements = job.spec.requirements;
  view.priority = job.spec.priority;
  view.numeric_profile = job.spec.numeric_profile;
  view.partition = job.spec.partition;
  view.failure = job.failure;
  view.waiting_reason = tables_.scheduler.WaitingReason(job);
  if (const absl::Status disk = disk_.Last(); job.phase == JobPhase::kLive && !disk.ok()) {
    view.waiting_reason =
        absl::StrCat(WhyWritesWait(disk), "; workers keep their results until it is");
  }
  view.warning = account.warning;
  view.pinned = account.pinned;
  view.parts_removed_time = KnownTime(account.parts_removed_time);
  view.create_time = account.create_time;
  view.end_time = KnownTime(account.end_time);
  view.failure_count = job.failures.count;
  view.frame_incomplete_count = job.incomplete_count;
  view.unapproved_frame_count = job.unapproved_count;
  const Deadline& deadline = job.spec.deadline;
  view.deadline_time = KnownTime(deadline.time);
  if (view.deadline_time && deadline.cpu_seconds > 0) {
    view.deadline_cpu_seconds = {deadline.cpu_seconds, deadline.cpu_seconds_low,
                                 deadline.cpu_seconds_high};
  }
  const JobRecords& jobs = tables_.scheduler.jobs();
  view.held = job.phase == JobPhase::kLive && (job.Paused() || !WhyHeld(jobs, job).empty());
  for (const JobDependency& dependency : job.spec.dependencies) {
    view.dependencies.push_back({absl::StrCat(dependency.job_id), dependency.by_frame,
                                 DependencyText(jobs, job, dependency)});
  }
  view.frame_count = static_cast<int32_t>(job.frames.size());
  view.frame_complete_count = job.delivered_count;
  if (with_frames) {
    view.effect_costs = job.spec.effect_costs;
    view.command = job.spec.command;
  }
  if (marks != nullptr) marks->resize(job.frames.size());
  for (size_t i = 0; i < job.frames.size(); ++i) {
    const FrameRecord& frame = job.frames[i];
    FrameView of_frame = ViewOf(job, frame, with_frames && marks == nullptr, now);
    AddProgress(of_frame.progress, &view.progress);
    view.training_frame_count += of_frame.is_training ? 1 : 0;
    NotePreviewFrame(of_frame, &view);
    if (!with_frames) continue;
    const auto rounds = account.rounds.find(frame.number());
    if (marks != nullptr) {
      const size_t round_count = rounds == account.rounds.end() ? 0 : rounds->second.size();
      const size_t mark = MarkOf(frame, of_frame, round_count);
      if (std::exchange((*marks)[i], mark) == mark) continue;
      of_frame = ViewOf(job, frame, /*with_spec=*/true, now);
    }
    if (rounds != account.rounds.end()) {
      of_frame.rounds =
          ViewsOf({job.spec.job_id, of_frame.frame_number}, rounds->second, previews_);
    }
    view.frames.push_back(std::move(of_frame));
  }
  ProgressView& progress = view.progress;
  const auto samples_done = static_cast<double>(std::max<uint64_t>(1, progress.sample_count_done));
  progress.relative_mse = AboveZero(progress.relative_mse.value_or(0) / samples_done);
  progress.wall_seconds = Seconds(tables_.WallOfJob(job, now));
  // The time that a user takes is unknown.
  if (job.phase == JobPhase::kLive && !job.Paused() && WhyHeld(jobs, job).empty()) {
    EstimateRemaining(job, now, &progress);
    AddBand(job, now, &progress);
  }
  if (job.phase == JobPhase::kSucceeded) progress.remaining_seconds = 0;
  const bool begun =
      progress.sample_count_done > 0 || tables_.scheduler.leases().CountOfJob(job.spec.job_id) > 0;
  view.state = StateOf(job, begun);
  return view;
}

FrameView JobViews::ViewOf(const JobRecord& job, const FrameRecord& frame, bool with_spec,
                           SteadyTime now) const {
  FrameView view;
  const FrameId id{job.spec.job_id, frame.number()};
  view.frame_number = frame.number();
  if (with_spec) {
    FrameSpec spec = frame.Spec();
    view.scene_digest = std::move(spec.scene.sha256_hex);
    view.scene_size_bytes = spec.scene.size_bytes;
    view.frame_digest = std::move(spec.frame_digest);
    view.certificate = SampleBoundOf(spec.settings).reason;
    view.settings = std::move(spec.settings);
    view.stop = spec.stop;
    view.resumed = std::move(spec.resumed);
  }
  view.is_training = frame.phase == FrameRecord::Phase::kOpen && !frame.tasks->Trained();
  view.complete = frame.phase == FrameRecord::Phase::kDelivered;
  if (with_spec) {
    if (frame.phase == FrameRecord::Phase::kIncomplete) view.incomplete = IncompleteText(frame);
    AddSetAside(frame, &view);
  }
  view.waiting_reason = WhyFrameWaits(tables_.scheduler.jobs(), job, frame);
  if (view.waiting_reason.empty()) view.waiting_reason = tables_.scheduler.WhyAwaitsChecks(id);
  const std::map<int32_t, int32_t>& corrections = tables_.accounts.at(id.job_id).corrections;
  const auto corrected = corrections.find(id.frame_number);
  if (corrected != corrections.end()) view.correction_count = corrected->second;
  ProgressView& progress = view.progress;
  progress.sample_count_done = frame.sample_count_done;
  progress.sample_count_total = tables_.SamplesExpected(id, frame);
  if (IsUnapproved(job.spec, frame.number())) {
    const uint64_t samples = job.spec.approvals.at(frame.number()).samples;
    progress.sample_count_total = progress.sample_count_total / frame.settings().samples * samples;
  }
  progress.nonfinite_count = frame.cost.nonfinite_count;
  progress.ray_count = frame.cost.ray_count;
  progress.cpu_seconds = Seconds(frame.cost.cpu_duration);
  if (view.complete) {
    const DeliveredFrame& delivered = tables_.accounts.at(id.job_id).delivered.at(id.frame_number);
    view.image_digest = delivered.image_digest;
    view.output_path =
        absl::StrCat(state_directory_, "/outputs/", id.job_id, "/", id.frame_number, ".exr");
    view.preview_version = IsUnapproved(job.spec, frame.number()) ? kUnapprovedPreviewVersion
                                                                  : kDeliveredPreviewVersion;
    progress.relative_mse = AboveZero(delivered.relative_mse);
    view.stop_reason = delivered.stop_reason;
    view.tile_count = delivered.tile_count;
    view.unreliable_tile_count = delivered.unreliable_tile_count;
    view.unreliable_layers = delivered.unreliable_layers;
    view.flip = AboveZero(delivered.flip);
    view.left_eye_relative_mse = AboveZero(delivered.left_eye_relative_mse);
    view.right_eye_relative_mse = AboveZero(delivered.right_eye_relative_mse);
    view.eye_difference_relative_mse = AboveZero(delivered.eye_difference_relative_mse);
    view.one_sequence_gain = AboveZero(delivered.one_sequence_gain);
    progress.wall_seconds = Seconds(delivered.wall_duration);
    progress.remaining_seconds = 0;
    return view;
  }
  if (const auto open = tables_.open_frames.find(id); open != tables_.open_frames.end()) {
    view.preview_version = open->second.preview_version;
    progress.relative_mse = AboveZero(open->second.relative_mse);
  }
  progress.wall_seconds = Seconds(tables_.WallOf(id, now));
  const bool begun = frame.first_lease_time != SteadyTime::InfiniteFuture();
  if (with_spec && begun && job.phase == JobPhase::kLive && !job.Paused()) {
    EstimateRemaining(job, now, &progress);
  }
  return view;
}

void JobViews::EstimateRemaining(const JobRecord& job, SteadyTime now,
                                 ProgressView* progress) const {
  const WorkLeft left =
      WorkLeftOf(job, progress->sample_count_total -
                          std::min(progress->sample_count_total, progress->sample_count_done));
  if (left.cpu_seconds_per_sample <= 0) return;
  const FarmLoad& load = tables_.LoadOf(job.spec.numeric_profile, now);
  if (load.threads_used <= 0) return;
  // A new job is not yet in the load.
  const double alone = left.sample_count * left.cpu_seconds_per_sample;
  progress->remaining_seconds = std::max(alone, load.ahead.CpuSeconds(left)) / load.threads_used;
}

void JobViews::AddBand(const JobRecord& job, SteadyTime now, ProgressView* progress) const {
  if (!progress->remaining_seconds) return;
  const SharedFarm::End* end =
      tables_.LoadOf(job.spec.numeric_profile, now).shared.Find(job.spec.job_id);
  if (end == nullptr) return;
  progress->remaining_seconds = end->wall_seconds.value;
  progress->remaining_low_seconds = end->wall_seconds.low;
  progress->remaining_high_seconds = end->wall_seconds.high;
  progress->remaining_alone_seconds = end->alone_seconds;
}

}  // namespace sheaf::coordinator
