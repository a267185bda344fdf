// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Serves the dashboard for a simulated farm whose images converge over time: for development of the
// page without rendering, and for tests with thousands of jobs and workers.
//
//   sheaf_page_server JOBS SECONDS [PORT [WORKERS [FRAMES]]]    prints "listening on URL", ends
//   after SECONDS
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/film/denoised_output.h"
#include "coordinator/service/http/http_service.h"
#include "tests/support/farm/http_fake_farm.h"

namespace {

using namespace sheaf;               // NOLINT: a program of one file.
using namespace sheaf::coordinator;  // NOLINT

constexpr int kWidthPx = 640;
constexpr int kHeightPx = 360;
constexpr uint64_t kSampleCount = 256;
constexpr int kFrameCount = 24;
// Edge of a tile in pixels; tiles have different numbers of samples.
constexpr int kTilePx = 40;
constexpr int kStereoJobsBefore = 2;  // The newest job but two is a stereo image.
constexpr int kWorkerCount = 3;
constexpr int32_t kUsageDayCount = 14;
constexpr int64_t kDaySeconds = 86400;
// No program listens there.
constexpr int kGrpcPort = 7411;
// Steps from the first sample to the last.
constexpr int kStepCount = 120;
constexpr absl::Duration kStep = absl::Milliseconds(250);

constexpr std::array kLayerChannels = {
    "albedo.R",        "albedo.G",        "albedo.B",       "normal.X",   "normal.Y",
    "normal.Z",        "depth.Z",         "denoised.R",     "denoised.G", "denoised.B",
    "denoisedError.R", "denoisedError.G", "denoisedError.B"};

// A soft sphere in front of a horizon, with the noise of this many samples. Its lit side is
// brighter than a screen can show.
FrameImage MakeImage(uint64_t samples, std::mt19937* random) {
  FrameImage image = MakeFakeImage(kWidthPx, kHeightPx, 0);
  std::normal_distribution<float> noise(0, 1);
  // The layers that every image has.
  std::vector<std::vector<float>> planes(kLayerChannels.size(),
                                         std::vector<float>(image.planes[0].size()));
  for (int y = 0; y < kHeightPx; ++y) {
    for (int x = 0; x < kWidthPx; ++x) {
      const float u = (static_cast<float>(x) - 0.5f * kWidthPx) / kHeightPx;
      const float v = (static_cast<float>(y) - 0.5f * kHeightPx) / kHeightPx;
      const float r2 = (u * u + v * v) * 12;
      const float shade = r2 < 1 ? std::max(0.04f, (std::sqrt(1 - r2) - 2 * u - 2 * v) * 0.8f) : 0;
      const float sky = v < 0.2f ? 0.35f - 0.5f * v : 0.12f;
      const float colors[3] = {r2 < 1 ? shade : sky * 0.8f, r2 < 1 ? shade * 0.6f : sky,
                               r2 < 1 ? shade * 0.2f : sky * 1.3f};
      const size_t pixel = static_cast<size_t>(y) * kWidthPx + static_cast<size_t>(x);
      const int fraction = (x / kTilePx + y / kTilePx) % 3 + 1;
      const float count = static_cast<float>(samples * static_cast<uint64_t>(fraction));
      const float spread = (r2 < 1 ? 1.0f : 0.3f) / std::sqrt(count);
      for (size_t c = 0; c < 3; ++c) {
        image.planes[c][pixel] = std::max(0.0f, colors[c] * (1 + spread * noise(*random)));
        image.planes[3 + c][pixel] = colors[c] * spread;
      }
      image.planes[6][pixel] = count;
      for (size_t c = 0; c < 3; ++c)
        planes[c][pixel] = r2 < 1 ? 0.9f - 0.3f * static_cast<float>(c) : 0.2f;
      const float normal[3] = {u * 3, -v * 3, std::sqrt(std::max(0.0f, 1 - r2))};
      for (size_t c = 0; c < 3; ++c) planes[3 + c][pixel] = r2 < 1 ? normal[c] : 0;
      planes[6][pixel] = r2 < 1 ? 4 - normal[2] : 20 - 8 * v;
      for (size_t c = 0; c < 3; ++c) {
        planes[7 + c][pixel] = colors[c];
        planes[10 + c][pixel] = 0.25f * colors[c] * spread;
      }
    }
  }
  for (size_t i = 0; i < planes.size(); ++i) {
    image.channel_names.emplace_back(kLayerChannels[i]);
    image.planes.push_back(std::move(planes[i]));
  }
  return image;
}

// Half of them are paused, the others wait for a machine that is not there.
JobView MakeQueuedJob(JobView job) {
  const bool paused = job.owner == "anna";
  job.state = paused ? JobState::kPaused : JobState::kQueued;
  if (!paused) job.waiting_reason = "no connected worker of its pool has the tag \"gpu\"";
  job.requirements.tags = {"gpu"};
  job.priority = paused ? -10 : 5;
  return job;
}

JobView MakeJob(int number, absl::Time create_time) {
  JobView job = MakeFakeJob(absl::StrCat(number));
  job.title = number % 7 == 3 ? "<script>alert(1)</script> & a rather long title that must be cut"
                              : absl::StrCat("shot ", number % 40 + 10, " / turntable");
  job.create_time = create_time;
  for (FrameView& frame : job.frames) {
    frame.settings.width_px = kWidthPx;
    frame.settings.height_px = kHeightPx;
    frame.settings.window = {0, 0, kWidthPx, kHeightPx};
    AddDenoised(&frame.settings.outputs);
  }
  job.owner = number % 3 == 0 ? "anna" : "ben";
  job.show = number % 2 == 0 ? "film" : "test";
  job.state = number % 11 == 5 ? JobState::kFailed : JobState::kSucceeded;
  if (job.state == JobState::kFailed) {
    job.failure_count = 2;
    job.failure = "turntable.0007.pbrt:41:7: material \"glass\": roughness 1.7 is outside [0, 1]";
  }
  if (job.state == JobState::kSucceeded && number % 13 == 2) return MakeQueuedJob(std::move(job));
  job.end_time = create_time + absl::Seconds(95);
  job.progress.sample_count_done = job.progress.sample_count_total;
  job.progress.relative_mse = 1.3e-3;
  job.progress.wall_seconds = 95;
  if (job.state == JobState::kSucceeded) {
    job.preview_frame = {FrameName(job.job_id, 1), 1, true};
  }
  return job;
}

// The newest job: its frames render one after another.
JobView MakeRunningJob(int number, int frame_count) {
  JobView job = MakeJob(number, absl::Now());
  job.title = absl::StrCat("turntable, ", frame_count, " frames");
  job.state = JobState::kRunning;
  job.preview_frame.reset();
  job.failure.clear();
  job.failure_count = 0;
  job.end_time.reset();
  job.frame_count = frame_count;
  FrameView frame = job.frames[0];
  frame.settings.samples = kSampleCount;
  frame.preview_version = 0;
  frame.progress = {};
  frame.progress.sample_count_total = uint64_t{kWidthPx} * kHeightPx * kSampleCount;
  job.frames.clear();
  for (int i = 1; i <= frame_count; ++i) {
    frame.frame_number = i;
    job.frames.push_back(frame);
  }
  job.progress = {};
  job.progress.sample_count_total =
      frame.progress.sample_count_total * static_cast<uint64_t>(frame_count);
  return job;
}

// The first frame completes kRoundFraction rounds, evenly spaced over its samples.
void EndRound(FrameView* frame, double relative_mse) {
  constexpr uint64_t kRoundFraction = 5;
  const ProgressView& progress = frame->progress;
  const uint64_t ended = progress.sample_count_done * kRoundFraction / progress.sample_count_total;
  while (frame->rounds.size() < ended) {
    RoundView round;
    round.relative_mse = round.relative_mse_upper = relative_mse;
    round.sample_count = progress.sample_count_done;
    round.cpu_seconds = round.wall_seconds = static_cast<double>(frame->rounds.size() + 1);
    round.preview_version = frame->rounds.size() + 1;
    frame->rounds.push_back(round);
  }
}

// Advances the running job by one step.
void Step(FakeFarm* farm, int step, std::mt19937* random) {
  if (farm->jobs.empty()) return;
  JobView& job = farm->jobs[0];
  if (job.state != JobState::kRunning) return;
  const double fraction = static_cast<double>(step) / kStepCount;
  ProgressView& sum = job.progress;
  sum.sample_count_done = 0;
  job.frame_complete_count = 0;
  job.preview_frame.reset();
  for (int i = 0; i < job.frame_count; ++i) {
    FrameView& frame = job.frames[static_cast<size_t>(i)];
    const double own = std::clamp(fraction * 6 - i * 5.0 / job.frame_count, 0.0, 1.0);
    frame.progress.sample_count_done =
        static_cast<uint64_t>(own * static_cast<double>(frame.progress.sample_count_total));
    frame.complete = own >= 1;
    if (own > 0 && frame.preview_version < kStepCount + 1) ++frame.preview_version;
    sum.sample_count_done += frame.progress.sample_count_done;
    job.frame_complete_count += frame.complete ? 1 : 0;
    NotePreviewFrame(frame, &job);
  }
  const double error = 0.4 / (1 + 255 * fraction);
  sum.relative_mse = error;
  EndRound(&job.frames[0], error);
  sum.wall_seconds = absl::ToDoubleSeconds(kStep) * step;
  sum.cpu_seconds = 2 * sum.wall_seconds;
  sum.remaining_seconds = absl::ToDoubleSeconds(kStep) * (kStepCount - step);
  sum.ray_count = sum.sample_count_done * 7;
  if (step >= kStepCount) {
    job.state = JobState::kSucceeded;
    job.end_time = absl::Now();
  }
  farm->preview.version = static_cast<uint64_t>(step) + 1;
  farm->preview.image = MakeImage(1 + static_cast<uint64_t>(fraction * kSampleCount), random);
  if (farm->round_preview.image.planes.empty()) farm->round_preview = farm->preview;
  for (WorkerView& worker : farm->workers) {
    worker.last_seen_time = absl::Now();
    worker.result_count += 3;
  }
  farm->metrics[1].value += 6;
}

void FillFarm(FakeFarm* farm, int job_count, int worker_count, int frame_count) {
  FailureRecord failure;
  failure.frame_number = 7;
  failure.tile = {320, 160, 360, 200};
  failure.block = {16, 16};
  failure.worker_id = "worker-0003";
  failure.kind = FailureKind::kScene;
  failure.message = "turntable.0007.pbrt:41:7: material \"glass\": roughness 1.7 is outside [0, 1]";
  failure.time = absl::Now();
  farm->failures.assign(2, {failure,
                            "sheaf render turntable.0007.pbrt --crop 320,160,360,200 "
                            "--samples 32 --max-depth 5 --seed 0"});
  farm->events = {{1, absl::Now(), "submit", "anna"},
                  {1, absl::Now(), "started", "workers/worker-0003", 1},
                  {1, absl::Now(), "failure", "workers/worker-0003", 7, failure.message},
                  {1, absl::Now(), "priority", "ben", std::nullopt, "5"}};
  if (job_count > 0) farm->jobs.push_back(MakeRunningJob(job_count, frame_count));
  const std::vector<EffectCost> effect_costs = {
      {"lens", "", "a pinhole", 0.043, 0.011, -0.0021, 0.0032, 1e-4, 1.02},
      {"indirect light", "", "direct light alone", 0.62, 0.018, -0.41, 0.006, 0.3, 1.7},
      {"choice of lights", "", "by power alone", -0.08, 0.03, 0.0004, 0.002, 1e-5, 0.31},
      {"motion", "", "a shutter of no length", -0.004, 0.011, 0.0021, 0.0032, 1e-4, 1.0},
      {"media", "the time limit was reached", "", 0, 0, 0, 0, 0, 0},
      {"everything", "", "an empty scene", 1.04, 0.02, -0.97, 0.01, 0.9, 40}};
  if (job_count > 0) farm->jobs.back().effect_costs = effect_costs;
  farm->prices.thread_count = worker_count;
  for (int i = job_count - 1; i > 0; --i) {
    farm->jobs.push_back(MakeJob(i, absl::Now() - absl::Minutes(3 * (job_count - i))));
    if (i != job_count - kStereoJobsBefore) continue;
    JobView& stereo = farm->jobs.back();
    stereo.title = "both eyes";
    stereo.command = "sheaf submit room.pbrt --stereo 0.065";
    for (FrameView& frame : stereo.frames) frame.settings.eye_distance = 0.065f;
  }
  farm->workers.resize(static_cast<size_t>(worker_count));
  for (int i = 0; i < worker_count; ++i) {
    WorkerView& worker = farm->workers[static_cast<size_t>(i)];
    worker.worker_id = absl::StrFormat("worker-%04d", i + 1);
    worker.identity = absl::StrCat("worker:node", i + 1);
    worker.host = absl::StrCat("render-", i + 1);
    const bool busy = i % 3 < 2;
    worker.state = busy ? WorkerState::kBusy : WorkerState::kLost;
    worker.thread_count = 1;
    worker.lease_count = busy ? 2 : 0;
    worker.samples_per_second = busy ? 1.83e6 : 0;
    if (busy) {
      const int32_t x0 = i * kTilePx % kWidthPx;
      worker.leases = {{{static_cast<uint64_t>(job_count), i % frame_count + 1},
                        {x0, 0, x0 + kTilePx, kTilePx},
                        {0, 16},
                        i % 4 == 0 ? LeasePhase::kLoading : LeasePhase::kRendering,
                        absl::Now()}};
      worker.warm_scenes = {"turntable.0001.pbrt", "turntable.0002.pbrt"};
      worker.warm_scene_count = 2;
      worker.scene_memory_bytes = 1'234'567'890;
    }
    worker.last_seen_time = absl::Now();
  }
  using Kind = MetricView::Kind;
  farm->metrics = {
      {"sheaf_leases_expired_total", "Leases that ran out.", Kind::kCounter, "", "", 2},
      {"sheaf_results_accepted_total", "Results merged.", Kind::kCounter, "", "", 0},
      {"sheaf_results_mismatch_total", "Duplicates that differ.", Kind::kCounter, "", "", 0},
      {"sheaf_workers", "Workers by state.", Kind::kGauge, "state", "busy", 2},
      {"sheaf_workers", "Workers by state.", Kind::kGauge, "state", "lost", 1}};
}

// Two users on each of the last kUsageDayCount days.
UsageReport MadeUpUsage() {
  const auto today = static_cast<int32_t>(absl::ToUnixSeconds(absl::Now()) / kDaySeconds);
  UsageReport report;
  for (int32_t i = 0; i < kUsageDayCount; ++i) {
    for (const char* user : {"anna", "ben"}) {
      Usage usage;
      usage.cpu_duration = absl::Hours((i * 7 + (user[0] == 'a' ? 3 : 11)) % 24);
      usage.sample_count = static_cast<uint64_t>(i + 1) * 1'000'000'000;
      usage.result_count = 1000;
      report.sums.push_back({today - i, user, "", "", usage});
    }
  }
  return report;
}

}  // namespace

int main(int argc, char** argv) {
  const int job_count = argc > 1 ? std::atoi(argv[1]) : 12;
  const int seconds = argc > 2 ? std::atoi(argv[2]) : 60;
  FakeFarm farm;
  const int worker_count = argc > 4 ? std::atoi(argv[4]) : kWorkerCount;
  const int frame_count = argc > 5 ? std::atoi(argv[5]) : kFrameCount;
  FillFarm(&farm, std::max(0, job_count), std::max(0, worker_count), std::max(1, frame_count));
  const auto change = [&farm](const std::string& job_id, auto apply) {
    absl::Status status = absl::NotFoundError(absl::StrCat("no job jobs/", job_id));
    farm.Update([&](FakeFarm& it) {
      for (JobView& job : it.jobs) {
        if (job.job_id != job_id) continue;
        apply(&job);
        status = absl::OkStatus();
      }
    });
    return status;
  };
  FarmActions actions;
  actions.change_job = [&](JobVerb verb, const std::string& job_id, const JobArguments& arguments) {
    const absl::Status changed = change(job_id, [&](JobView* job) {
      if (verb == JobVerb::kCancelJob) {
        job->state = JobState::kCancelled;
        job->end_time = absl::Now();
      }
      if (verb == JobVerb::kPauseJob) job->state = JobState::kPaused;
      if (verb == JobVerb::kResumeJob || verb == JobVerb::kRefineJob) {
        job->state = JobState::kRunning;
      }
      if (verb == JobVerb::kApproveFrames) job->unapproved_frame_count = 0;
      if (verb == JobVerb::kPinJob || verb == JobVerb::kUnpinJob) {
        job->pinned = verb == JobVerb::kPinJob;
      }
      if (verb == JobVerb::kSetJobPriority) job->priority = arguments.priority;
    });
    if (verb == JobVerb::kDeleteJob) {
      farm.Update([&](FakeFarm& it) {
        std::erase_if(it.jobs, [&](const JobView& job) { return job.job_id == job_id; });
      });
    }
    return changed;
  };
  actions.drain_worker = [&](const std::string& worker_id, bool drain) {
    absl::Status status = absl::NotFoundError(absl::StrCat("no worker workers/", worker_id));
    farm.Update([&](FakeFarm& it) {
      for (WorkerView& worker : it.workers) {
        if (worker.worker_id != worker_id) continue;
        worker.drained = drain;
        worker.state = drain ? WorkerState::kDraining : WorkerState::kIdle;
        status = absl::OkStatus();
      }
    });
    return status;
  };
  actions.read_pixel = [&](const std::string&, int32_t, int32_t x_px, int32_t y_px) {
    absl::StatusOr<PixelView> pixel;
    farm.Update([&](FakeFarm& it) { pixel = FakePixel(it.preview, x_px, y_px); });
    return pixel;
  };
  actions.address = [] { return FarmAddress{kGrpcPort, false}; };
  actions.list_usage = [](const UsageQuery&) -> absl::StatusOr<UsageReport> {
    return MadeUpUsage();
  };
  actions.collect_garbage = [](bool) -> absl::StatusOr<std::vector<RemovalView>> {
    return std::vector<RemovalView>();
  };
  HttpServiceOptions options;
  options.server.port = static_cast<uint16_t>(argc > 3 ? std::atoi(argv[3]) : 0);
  const auto service = HttpService::Start(options, farm, std::move(actions));
  if (!service.ok()) {
    std::fprintf(stderr, "%s\n", service.status().ToString().c_str());
    return 1;
  }
  std::printf("listening on %s\n", (*service)->Url().c_str());
  std::fflush(stdout);
  std::mt19937 random(1);
  const absl::Time end = absl::Now() + absl::Seconds(seconds);
  for (int step = 1; absl::Now() < end; ++step) {
    if (step <= kStepCount) farm.Update([&](FakeFarm& it) { Step(&it, step, &random); });
    absl::SleepFor(kStep);
  }
  return 0;
}
