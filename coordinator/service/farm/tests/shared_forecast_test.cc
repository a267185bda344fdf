// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Forecasts of when jobs end, on a simulated farm that several jobs share, against what then
// happens. Prints the figures that docs/scheduling.md quotes.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <vector>

#include "coordinator/forecast/shared_farm.h"
#include "coordinator/scheduling/tests/simulated_farm.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr int kSeeds = 8;

// As FarmTables::LoadOf does it.
SharedFarm ForecastOf(const Scheduler& scheduler) {
  double threads_used = 0;
  for (const auto& [id, worker] : scheduler.workers().workers()) {
    if (worker.Live()) threads_used += worker.ThreadsUsed();
  }
  std::vector<SharedJob> shared;
  for (const auto& [id, job] : scheduler.jobs()) {
    if (job.phase != JobPhase::kLive) continue;
    uint64_t total = 0, done = 0;
    for (const FrameRecord& frame : job.frames) {
      total += SampleCountTotal(frame);
      done += frame.sample_count_done;
    }
    shared.push_back({id, WorkLeftOf(job, total - done),
                      static_cast<double>(done) / static_cast<double>(total)});
  }
  return SharedFarm(std::move(shared), threads_used, ShareByTime);
}

struct Forecasts {
  std::vector<double> errors;  // Relative, without sign.
  int in_band = 0;
  double naive_error = 0;  // The largest error of "what is left at the job's present speed".
};

double MedianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// Five jobs at once, of one to four frames and costs that differ tenfold, the last of higher
// priority; 8 workers of 4 threads. Notes the forecasts at this fraction of the time that all of it
// takes.
void Play(uint64_t seed, double fraction, Forecasts* forecasts) {
  const std::vector<SimulatedScene> scenes = {
      {"a", 3, 2e-5}, {"b", 1, 4e-5}, {"c", 6, 8e-5}, {"d", 2, 1e-5}, {"e", 1, 1e-4}};
  constexpr int kFrames[] = {4, 2, 1, 3, 1};
  constexpr uint64_t kSamples[] = {256, 512, 128, 512, 64};
  SimulatedFarmOptions options;
  options.worker_count = 8;
  options.thread_count = 4;
  options.seed = seed;
  SimulatedFarm farm(Limits(), options, scenes);
  double cpu_seconds = 0;
  for (uint64_t i = 0; i < scenes.size(); ++i) {
    farm.AddJob(i + 1, scenes[i].name, kFrames[i], 512, kSamples[i], i == 4 ? 1 : 0);
    cpu_seconds +=
        scenes[i].seconds_per_sample * kFrames[i] * 512 * 512 * static_cast<double>(kSamples[i]);
  }
  const SteadyTime time = SteadyTime() + absl::Seconds(fraction * cpu_seconds / (8 * 4));
  farm.RunUntil(time);
  const SharedFarm forecast = ForecastOf(farm.scheduler());
  std::map<uint64_t, SharedFarm::End> ends;
  std::map<uint64_t, double> naive;
  for (const auto& [id, job] : farm.scheduler().jobs()) {
    if (const SharedFarm::End* end = forecast.Find(id)) ends[id] = *end;
    uint64_t total = 0, done = 0;
    for (const FrameRecord& frame : job.frames) {
      total += SampleCountTotal(frame);
      done += frame.sample_count_done;
    }
    if (done > 0) {
      naive[id] = absl::ToDoubleSeconds(time - SteadyTime()) * static_cast<double>(total - done) /
                  static_cast<double>(done);
    }
  }
  EXPECT_GE(ends.size(), 2u);
  farm.RunUntil(SteadyTime() + absl::Hours(24));
  ASSERT_EQ(farm.live_jobs(), 0);
  for (const auto& [id, end] : ends) {
    const double actual = absl::ToDoubleSeconds(farm.ended().at(id) - time);
    const double forecast_seconds = end.wall_seconds.value;
    forecasts->errors.push_back(std::abs(forecast_seconds - actual) / actual);
    if (end.wall_seconds.low <= actual && actual <= end.wall_seconds.high) ++forecasts->in_band;
    if (naive.contains(id)) {
      forecasts->naive_error =
          std::max(forecasts->naive_error, std::abs(naive[id] - actual) / actual);
    }
  }
}

TEST(SharedForecastTest, ForecastsKnowOfTheOtherJobs) {
  for (const double fraction : {0.15, 0.5}) {
    SCOPED_TRACE(fraction);
    Forecasts forecasts;
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) Play(seed, fraction, &forecasts);
    const double median = MedianOf(forecasts.errors);
    const double worst = *std::max_element(forecasts.errors.begin(), forecasts.errors.end());
    const double in_band =
        static_cast<double>(forecasts.in_band) / static_cast<double>(forecasts.errors.size());
    std::printf(
        "after %2.0f %% of the time: %zu forecasts, median error %.1f %%, worst %.0f %%, "
        "%.0f %% within their bands; at the present speed of each job up to %.0f %%\n",
        100 * fraction, forecasts.errors.size(), 100 * median, 100 * worst, 100 * in_band,
        100 * forecasts.naive_error);
    EXPECT_LT(median, 0.25);
    EXPECT_GE(in_band, 0.6);
    EXPECT_GT(forecasts.naive_error, 2 * median);
  }
}

}  // namespace
}  // namespace sheaf::coordinator
