// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whole farms that render many scenes: how often workers load, how long jobs wait, and how long
// leases are. Prints the figures that docs/scheduling.md quotes.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "coordinator/scheduling/tests/simulated_farm.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

// The examples of scenes/ and known public scenes, measured as docs/scheduling.md says. The sample
// of killeroo-coated-gold is that of killeroo-moving: its own was lost in the noise.
constexpr SimulatedScene kMeasured[] = {
    {"ajar", 1.38, 8.02e-6},
    {"caustic", 0.44, 4.00e-6},
    {"cloud", 0.28, 1.15e-5},
    {"cornell-box", 0.28, 5.23e-6},
    {"fire", 0.36, 5.39e-6},
    {"fog-room", 0.21, 9.10e-6},
    {"frosted", 1.18, 7.92e-6},
    {"insides", 0.29, 1.21e-5},
    {"lens", 0.43, 3.33e-6},
    {"pool", 0.66, 9.93e-6},
    {"showroom", 1.64, 6.64e-6},
    {"killeroo-simple", 0.56, 1.34e-6},
    {"killeroo-coated-gold", 3.06, 3.90e-6},
    {"killeroo-moving", 0.41, 3.90e-6},
    {"material-testball", 2.21, 6.71e-6},
    {"staircase2", 2.00, 1.08e-5},
    {"teapot-cloud", 2.01, 1.46e-5},
    {"veach-mis", 0.34, 2.31e-6},
    {"volumetric-caustic", 4.06, 1.85e-4},
    {"cornell-box-specular", 0.21, 4.55e-6},
};

struct Figures {
  double cold_of_leases = 0, cold_of_frame_starts = 0, load_fraction = 0;
  absl::Duration longest_wait, job_duration, makespan;
};

// 500 jobs of 20 scenes on 50 workers: 100 at once, then one every two seconds. A few scenes have
// most of the jobs, as in a production.
Figures RenderManyScenes(const Limits& limits) {
  const std::vector<SimulatedScene> scenes(std::begin(kMeasured), std::end(kMeasured));
  SimulatedFarm farm(limits, {}, scenes);
  std::mt19937_64 random(7);
  for (uint64_t id = 1; id <= 500; ++id) {
    if (id > 100) farm.RunUntil(SteadyTime() + absl::Seconds(2 * (id - 100)));
    const double u = static_cast<double>(random() >> 11) * 0x1p-53;
    const auto scene = static_cast<size_t>(u * u * static_cast<double>(scenes.size()));
    // Jobs of equal cost, about: three minutes of a thread each.
    const double samples = 180 / (scenes[scene].seconds_per_sample * 256 * 256);
    farm.AddJob(id, scenes[scene].name, 1, 256, std::max<uint64_t>(16, std::llround(samples)));
  }
  farm.RunUntil(SteadyTime() + absl::Hours(24));
  EXPECT_EQ(farm.live_jobs(), 0);
  const Counters& counters = farm.scheduler().counters();
  const auto cold = static_cast<double>(counters.leases_cold);
  return {cold / static_cast<double>(counters.leases_granted),
          cold / static_cast<double>(farm.frame_starts()),
          farm.load_seconds() / (farm.load_seconds() + farm.render_seconds()),
          farm.longest_wait(),
          farm.MeanJobDuration(),
          farm.last_end() - SteadyTime()};
}

void Print(const char* name, const Figures& figures) {
  std::printf(
      "%-7s cold %5.1f %% of leases, %5.1f %% of frames begun; loading %4.1f %% of the "
      "time; a job takes %4.0f s; the first lease after %3.0f s at most; all done after %5.0f s\n",
      name, 100 * figures.cold_of_leases, 100 * figures.cold_of_frame_starts,
      100 * figures.load_fraction, absl::ToDoubleSeconds(figures.job_duration),
      absl::ToDoubleSeconds(figures.longest_wait), absl::ToDoubleSeconds(figures.makespan));
}

TEST(WarmFarmTest, FewLeasesAreColdAndNobodyStarves) {
  Limits before;
  before.warm_wait_max = before.warm_stay_min = absl::ZeroDuration();
  const Figures without = RenderManyScenes(before);
  const Figures with = RenderManyScenes(Limits());
  Print("before:", without);
  Print("now:", with);
  EXPECT_LT(with.cold_of_leases, 0.2);
  EXPECT_LT(with.cold_of_leases, without.cold_of_leases / 3);
  EXPECT_LT(with.makespan, without.makespan * 1.02);
  EXPECT_LT(with.job_duration, without.job_duration);
  // A job that may be passed over no longer waits for its turn among such jobs.
  EXPECT_LT(with.longest_wait, 2 * (Limits().warm_wait_max + Limits().warm_stay_min));
}

// One long frame on a farm of workers with many threads: leases take about ten seconds, and all
// workers finish together.
TEST(WarmFarmTest, LeasesOfALongFrameAreLongAndEndTogether) {
  SimulatedFarmOptions options;
  options.worker_count = 8;
  options.thread_count = 16;
  SimulatedFarm farm(Limits(), options, {{"long", 1, 2e-5}});
  farm.AddJob(1, "long", 1, 2048, 1024);
  farm.RunUntil(SteadyTime() + absl::Hours(24));
  ASSERT_EQ(farm.live_jobs(), 0);
  std::vector<double> seconds = farm.lease_seconds();
  // Weighted by duration, since the target is a duration.
  std::sort(seconds.begin(), seconds.end());
  double sum = 0, below = 0;
  for (const double s : seconds) sum += s;
  double median = 0;
  for (const double s : seconds) {
    below += s;
    if (below >= sum / 2) {
      median = s;
      break;
    }
  }
  const std::vector<SteadyTime> ends = farm.last_ends();
  const absl::Duration spread =
      *std::max_element(ends.begin(), ends.end()) - *std::min_element(ends.begin(), ends.end());
  std::printf(
      "half of the time is in leases of %.1f s or more; %zu leases, the longest %.1f s; "
      "the last ones end within %.1f s of %.0f s\n",
      median, seconds.size(), seconds.back(), absl::ToDoubleSeconds(spread),
      absl::ToDoubleSeconds(farm.last_end() - SteadyTime()));
  EXPECT_GT(median, 5.0);
  EXPECT_LT(median, 20.0);
  EXPECT_LT(seconds.back(), 40.0);
  EXPECT_LT(spread, absl::Seconds(5));
}

}  // namespace
}  // namespace sheaf::coordinator
