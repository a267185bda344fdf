// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/load_phases.h"

#include <gtest/gtest.h>

#include <ctime>
#include <set>
#include <string>
#include <thread>

namespace sheaf {
namespace {

// Keeps this thread busy for so much of its own CPU time.
void Work(double seconds) {
  const auto now = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  const double end = now() + seconds;
  while (now() < end) {
  }
}

double CpuOf(const LoadTimes& before, const LoadTimes& after, LoadPhase phase) {
  return after.Of(phase).cpu_seconds - before.Of(phase).cpu_seconds;
}

double WallOf(const LoadTimes& before, const LoadTimes& after, LoadPhase phase) {
  return after.Of(phase).wall_seconds - before.Of(phase).wall_seconds;
}

TEST(LoadPhasesTest, EachHasAName) {
  std::set<std::string> names;
  for (size_t i = 0; i < kLoadPhaseCount; ++i) {
    names.insert(LoadPhaseName(static_cast<LoadPhase>(i)));
  }
  EXPECT_EQ(names.size(), kLoadPhaseCount);
}

TEST(LoadPhasesTest, PhasesWithinAPhaseAreTheirOwn) {
  const LoadTimes before = LoadTimesNow();
  {
    const PhaseTimer read(LoadPhase::kRead);
    Work(0.01);
    {
      const PhaseTimer meshes(LoadPhase::kMeshes);
      Work(0.05);
    }
    Work(0.01);
  }
  const LoadTimes after = LoadTimesNow();
  EXPECT_GE(CpuOf(before, after, LoadPhase::kRead), 0.02);
  EXPECT_LT(CpuOf(before, after, LoadPhase::kRead), 0.05);
  EXPECT_GE(CpuOf(before, after, LoadPhase::kMeshes), 0.05);
  EXPECT_GE(WallOf(before, after, LoadPhase::kMeshes), 0.05);
  EXPECT_EQ(after.Of(LoadPhase::kRead).count, before.Of(LoadPhase::kRead).count + 1);
  EXPECT_GE(after.covered_wall_seconds - before.covered_wall_seconds, 0.07);
}

TEST(LoadPhasesTest, AWholePhaseHasAllThatIsWithin) {
  const LoadTimes before = LoadTimesNow();
  {
    const PhaseTimer check(LoadPhase::kCheck, PhaseCpu::kThread, PhaseExtent::kWhole);
    const PhaseTimer lights(LoadPhase::kLights);
    const PhaseTimer images(LoadPhase::kImages);
    Work(0.02);
  }
  const LoadTimes after = LoadTimesNow();
  EXPECT_GE(CpuOf(before, after, LoadPhase::kCheck), 0.02);
  EXPECT_EQ(CpuOf(before, after, LoadPhase::kLights), 0);
  EXPECT_EQ(after.Of(LoadPhase::kImages).count, before.Of(LoadPhase::kImages).count);
}

TEST(LoadPhasesTest, ThreadsOfAPhaseCountItsWallTimeOnce) {
  const LoadTimes before = LoadTimesNow();
  {
    const PhaseTimer outer(LoadPhase::kStore);
    std::jthread other([] {
      const PhaseTimer inner(LoadPhase::kStore);
      Work(0.02);
    });
    Work(0.02);
  }
  const LoadTimes after = LoadTimesNow();
  EXPECT_GE(CpuOf(before, after, LoadPhase::kStore), 0.04);
  EXPECT_NEAR(WallOf(before, after, LoadPhase::kStore),
              after.covered_wall_seconds - before.covered_wall_seconds, 1e-6);
}

TEST(LoadPhasesTest, APhaseMayCountThreadsThatWorkForIt) {
  const LoadTimes before = LoadTimesNow();
  {
    const PhaseTimer tracer(LoadPhase::kTracer, PhaseCpu::kProcess);
    std::jthread([] { Work(0.03); }).join();
  }
  EXPECT_GE(CpuOf(before, LoadTimesNow(), LoadPhase::kTracer), 0.03);
}

TEST(LoadPhasesTest, TheProcessHasAllTime) {
  EXPECT_EQ(LoadTimesNow().first_sample.wall_seconds, 0);
  { const PhaseTimer samples(LoadPhase::kSamples); }
  const LoadTimes now = LoadTimesNow();
  EXPECT_GT(now.process.wall_seconds, 0);
  EXPECT_LT(now.process.wall_seconds, 3600) << "since the process started";
  EXPECT_GT(now.process.cpu_seconds, 0);
  EXPECT_GT(now.first_sample.wall_seconds, 0);
  EXPECT_LE(now.first_sample.wall_seconds, now.process.wall_seconds);
}

}  // namespace
}  // namespace sheaf
