// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/golden/made_up_views.h"

namespace sheaf::coordinator {
namespace {

ProgressView MadeUpProgress(double scale) {
  ProgressView progress;
  progress.sample_count_done = static_cast<uint64_t>(scale * 1000);
  progress.sample_count_total = static_cast<uint64_t>(scale * 4000);
  progress.relative_mse = scale * 0.0625;
  progress.nonfinite_count = 3;
  progress.ray_count = 123456;
  progress.cpu_seconds = scale * 12.5;
  progress.wall_seconds = scale * 2.25;
  progress.remaining_seconds = scale * 30;
  progress.remaining_low_seconds = scale * 20.5;
  progress.remaining_high_seconds = scale * 40.5;
  progress.remaining_alone_seconds = scale * 10.5;
  return progress;
}

FrameView MadeUpFrame() {
  FrameView frame;
  frame.frame_number = 7;
  frame.scene_digest = std::string(64, 'a');
  frame.scene_size_bytes = 1234;
  frame.frame_digest = std::string(64, 'b');
  frame.settings = MadeUpSettings();
  frame.stop = {.target_error = 0.25,
                .time_max = absl::Minutes(3),
                .cpu_max = absl::Hours(2),
                .certified = true};
  frame.resumed = {std::string(64, 'c'), 55};
  frame.stop_reason = StopReason::kTargetError;
  frame.tile_count = 12;
  frame.unreliable_tile_count = 5;
  frame.unreliable_layers = {{"caustic", 4}, {"key", 1}};
  frame.flip = 0.125;
  frame.left_eye_relative_mse = 0.0625;
  frame.right_eye_relative_mse = 0.03125;
  frame.eye_difference_relative_mse = 0.015625;
  frame.one_sequence_gain = 1.5;
  frame.certificate = "X, Y and Z of a sample are at most 12.5";
  frame.rounds = {{0.5, 0.75, 0.25, 0, 100, 200, 1.5, 0.5, 300, 0.875, 0},
                  {0.25, 0.3125, 0, 1.25, 400, 500, 2.5, 1.25, 600, 0.4375, 9}};
  frame.is_training = true;
  frame.complete = true;
  frame.incomplete = "2 tasks are set aside";
  frame.waiting_reason = "waits for approval";
  frame.set_aside = {
      {3, "killed by anna", {}},
      {4, "failed too often", {{"memory", "w-1", 2, "lack of memory"}, {"lost", "", 1, ""}}}};
  frame.set_aside_count = 17;
  frame.correction_count = 2;
  frame.image_digest = std::string(64, 'd');
  frame.output_path = "/state/outputs/5/7.exr";
  frame.preview_version = 11;
  frame.progress = MadeUpProgress(1);
  return frame;
}

}  // namespace

FrameSettings MadeUpSettings() {
  FrameSettings settings;
  settings.width_px = 640;
  settings.height_px = 480;
  settings.window = {1, 2, 33, 44};
  settings.samples = 77;
  settings.max_depth = 9;
  settings.seed = UINT64_MAX - 1;
  settings.color = ColorTransport::kSpectral;
  settings.single_scattering = true;
  settings.one_sequence = true;
  settings.similarity_after = 24;
  settings.light_samples = 8;
  settings.techniques = TechniqueSet::kCameraAndLightGuided;
  settings.force_generic_variant = true;
  settings.lattice = {8, settings.seed};
  settings.outputs.Add(Aov::kUv);
  settings.sensor = "nikon_d850";
  settings.max_component_value = 12.5f;
  settings.primaries = Primaries::kRec2020;
  settings.white_balance_k = 3200.5f;
  return settings;
}

JobView MadeUpJob() {
  JobView job;
  job.job_id = "5";
  job.pilot = true;
  job.title = "two\nlines and \xff";
  job.owner = "anna";
  job.show = "comet";
  job.requirements = {"gpu", {"big", "fast"}, 1000, 2000};
  job.state = JobState::kPaused;
  job.priority = -3;
  job.numeric_profile = "build/x86-64-v3";
  job.partition = {16, 4, 2, 8};
  job.failure = "scene.pbrt:3:1: a failure";
  job.waiting_reason = "no worker of the profile";
  job.warning = "corrected";
  job.failure_count = 6;
  job.pinned = true;
  job.parts_removed_time = absl::FromUnixMillis(1'700'000'300'125);
  job.create_time = absl::FromUnixMillis(1'700'000'000'123);
  job.end_time = absl::FromUnixMillis(1'700'000'200'456);
  job.frame_count = 20;
  job.frame_complete_count = 19;
  job.frame_incomplete_count = 18;
  job.training_frame_count = 13;
  job.unapproved_frame_count = 14;
  job.dependencies = {{"2", true, "waits"}, {"3", false, "has failed"}};
  job.deadline_time = absl::FromUnixMillis(1'700'009'000'500);
  job.deadline_cpu_seconds = {3600.5, 3000.25, 4000.75};
  job.held = true;
  job.command = "sheaf submit kitchen.pbrt --samples 64";
  job.effect_costs = {{"lens", "", "a pinhole", 0.25, 0.01, -0.002, 0.003, 1e-4, 1.5},
                      {"indirect light", "the time limit was reached", "", 0, 0, 0, 0, 0, 0}};
  job.progress = MadeUpProgress(2);
  job.frames = {MadeUpFrame()};
  NotePreviewFrame(job.frames[0], &job);
  FrameView& unknown = job.frames.emplace_back();
  unknown.frame_number = 8;
  unknown.scene_digest = std::string(64, 'e');
  unknown.frame_digest = std::string(64, 'f');
  return job;
}

WorkerView MadeUpWorker() {
  WorkerView worker;
  worker.worker_id = "w-1";
  worker.identity = "identity-1";
  worker.host = "render-07";
  worker.state = WorkerState::kSick;
  worker.thread_count = 16;
  worker.traits = {"gpu", {"big", "fast"}, 4000};
  worker.numeric_profile = "build/x86-64-v3";
  worker.lease_count = 9;
  worker.result_count = 10;
  worker.samples_per_second = 1234.5;
  worker.lease_granted_count = 21;
  worker.lease_cold_count = 4;
  worker.last_seen_time = absl::FromUnixMillis(1'700'000'100'789);
  worker.reason = "failed tasks of 3 jobs";
  worker.drained = true;
  worker.exits = true;
  worker.leases = {{{5, 7},
                    {0, 0, 32, 16},
                    {64, 16},
                    LeasePhase::kRendering,
                    absl::FromUnixMillis(1'700'000'050'000),
                    TaskKind::kLight},
                   {{kFirstPilotId, 1},
                    {32, 0, 64, 16},
                    {0, 16},
                    LeasePhase::kUploading,
                    absl::FromUnixMillis(1'700'000'060'000),
                    TaskKind::kCamera}};
  worker.warm_scenes = {"kitchen.pbrt", "garden.glb"};
  worker.warm_scene_count = 3;
  worker.scene_memory_bytes = 5'000'000'000;
  return worker;
}

FailureView MadeUpFailure() {
  FailureView view;
  view.failure.frame_number = 7;
  view.failure.tile = {0, 16, 32, 48};
  view.failure.block = {64, 16};
  view.failure.worker_id = "w-1";
  view.failure.kind = FailureKind::kMemory;
  view.failure.message = "lack of memory";
  view.failure.time = absl::FromUnixMillis(1'700'000'070'250);
  view.failure.task_kind = TaskKind::kTraining;
  view.command = "sheaf render kitchen.pbrt --crop 0,16,32,48";
  return view;
}

std::vector<JobEvent> MadeUpEvents() {
  const absl::Time time = absl::FromUnixMillis(1'700'000'000'123);
  return {{3, time, "submit", "anna"},
          {3, time + absl::Seconds(2), "failure", "workers/w-1", 7, "lack of memory"}};
}

RefinementPrices MadeUpPrices() {
  RefinementPrices priced;
  priced.prices = {{0.5, true, {0.4, 0.3, 0.5}, {64, 60, 70}, {10, 8, 12}, Estimate{5, 4, 6}}};
  priced.thread_count = 8;
  priced.jobs_before_count = 2;
  return priced;
}

std::vector<ShareView> MadeUpShares() {
  return {{"user:anna", true, {2.5, 12}, 3, 40}, {"pool:gpu", false, {}, 0, 0}};
}

std::vector<RemovalView> MadeUpRemovals() {
  return {{"parts", "5", "older than 7 days", 1, 4096}, {"blob", "", "is not used", 12, 8192}};
}

UsageReport MadeUpUsage() {
  UsageReport report;
  UsageSum& sum = report.sums.emplace_back();
  sum.day = 19'676;
  sum.user = "anna";
  sum.show = "comet";
  sum.job = "jobs/5";
  sum.usage = {
      1, 2,  3, absl::Milliseconds(4500), 5, absl::Milliseconds(600), 7, absl::Milliseconds(80),
      9, 10, 11};
  report.sums.emplace_back().user = "bert";
  report.stored = {{"anna", {1, 20, 300, 4000}, 50'000}, {"bert", {}, UINT64_MAX}};
  return report;
}

std::vector<MetricView> MadeUpMetrics() {
  return {{"sheaf_results_total", "Results.", MetricView::Kind::kCounter, "outcome", "late", 3},
          {"sheaf_jobs", "Jobs.", MetricView::Kind::kGauge, "", "", 0.5},
          {"sheaf_wait_seconds", "Waits.", MetricView::Kind::kHistogram, "", "", 1, {}, "_sum"}};
}

}  // namespace sheaf::coordinator
