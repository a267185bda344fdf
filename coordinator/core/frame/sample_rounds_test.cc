// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/sample_rounds.h"

#include <cmath>
#include <vector>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr int64_t kTilePixels = 256;
constexpr uint64_t kSamplesMax = 1 << 20;

// A cell in which every pixel has the error k / n^rate.
CellRound CellAt(double k, uint64_t samples, double rate = 1) {
  const double error = k * std::pow(static_cast<double>(samples), -rate);
  const auto count = static_cast<double>(kTilePixels);
  return {samples, {kTilePixels, count * error, count * error * error}};
}

StopRule Target(double error) { return {.target_error = error}; }

struct Course {
  std::vector<uint64_t> samples;
  std::vector<CellRound> cells;
  RoundDecision last;
  std::vector<RoundRecord> records;
  int round_count = 0;
};
// Renders cells until they are done. ks: their errors at one sample.
Course RunToTheEnd(const StopRule& rule, const std::vector<double>& ks, double rate = 1,
                   uint64_t samples_max = kSamplesMax) {
  Course run;
  run.samples.assign(ks.size(), uint64_t{kReplicateCount});
  std::vector<CellRound> before;
  while (run.round_count < 100) {
    run.cells.clear();
    for (size_t i = 0; i < ks.size(); ++i) run.cells.push_back(CellAt(ks[i], run.samples[i], rate));
    run.last = DecideRound(rule, samples_max, run.round_count++, run.cells, before, {});
    RoundRecord& record = run.records.emplace_back();
    record.round = run.round_count - 1;
    record.cells = run.cells;
    record.Take(run.last);
    if (run.last.samples.empty()) return run;
    for (size_t i = 0; i < ks.size(); ++i) {
      EXPECT_GE(run.last.samples[i], run.samples[i]);
      EXPECT_LE(run.last.samples[i], kRoundGrowthMax * run.samples[i]);
      EXPECT_TRUE(run.last.samples[i] % kReplicateCount == 0 || run.last.samples[i] == samples_max);
    }
    before = run.cells;
    run.samples = run.last.samples;
  }
  ADD_FAILURE() << "did not end";
  return run;
}

double MeanSamples(const Course& run) {
  double sum = 0;
  for (const uint64_t samples : run.samples) sum += static_cast<double>(samples);
  return sum / static_cast<double>(run.samples.size());
}

double BoundOverError(const Course& run) {
  return run.last.relative_mse_upper / run.last.relative_mse;
}

TEST(SampleRoundsTest, ReachesTheTargetWithFewExtraSamples) {
  // 1 / n = 0.001 at 1000 samples, plus some for the confidence.
  const Course run = RunToTheEnd(Target(1e-3), std::vector<double>(1000, 1.0));
  EXPECT_EQ(run.last.reason, StopReason::kTargetError);
  EXPECT_LE(run.last.relative_mse_upper, 1e-3);
  EXPECT_GE(MeanSamples(run), 1000);
  EXPECT_LE(MeanSamples(run) / BoundOverError(run), 1070);
  EXPECT_LE(BoundOverError(run), 1 + 3.2 * kEstimateDeviation);
  EXPECT_LE(run.round_count, 5);
}

// A frame without any noise, in which things of less than a pixel may be missing.
TEST(SampleRoundsTest, FramesWithoutNoiseAreLookedAtAgain) {
  constexpr double kTarget = 0.02;
  // 20 of 1024 pixels would be off by the target; 3 / (20 / 512) samples.
  const Course small = RunToTheEnd(Target(kTarget), std::vector<double>(4, 0.0));
  EXPECT_EQ(small.last.reason, StopReason::kTargetError);
  EXPECT_EQ(MeanSamples(small), 80);
  EXPECT_EQ(small.round_count, 3);
  EXPECT_EQ(small.records.front().sample_count_expected, 80u * 4 * kTilePixels);
  // The probability that 20 pixels of which 1 / 512 is covered stay unseen.
  EXPECT_LT(std::exp(-MeanSamples(small) * kTarget * 1024 / 512), 0.05);
  const Course large = RunToTheEnd(Target(kTarget), std::vector<double>(400, 0.0));
  EXPECT_EQ(MeanSamples(large), kReplicateCount);
  EXPECT_EQ(large.round_count, 1);
  // Not beyond the limit, nor the growth of a round.
  EXPECT_EQ(MeanSamples(RunToTheEnd(Target(kTarget), std::vector<double>(4, 0.0), 1, 32)), 32);
  const Course tiny = RunToTheEnd(Target(kTarget), {0.0});
  EXPECT_EQ(MeanSamples(tiny), kLookSamplesMax);
  EXPECT_EQ(tiny.round_count, 3);
}

// Cells after the first round.
std::vector<CellRound> UnequalCells() {
  std::vector<CellRound> cells;
  for (int i = 0; i < 1000; ++i) {
    cells.push_back(CellAt(std::exp(1.2 * std::sin(i)), kReplicateCount));
  }
  return cells;
}

// Samples come in steps of 16. If little more is needed, few cells take another step, instead of
// all of them.
TEST(SampleRoundsTest, RoundsDoNotOvershoot) {
  const std::vector<CellRound> cells = UnequalCells();
  const double error = SumOf(cells).RelativeMse();
  for (const double target : {0.9 * error, 0.7 * error, 0.5 * error}) {
    const RoundDecision decision = DecideRound(Target(target), kSamplesMax, 0, cells, {}, {});
    const double aim = target * decision.relative_mse / decision.relative_mse_upper;
    EXPECT_LE(decision.predicted_relative_mse, aim);
    EXPECT_GE(decision.predicted_relative_mse, 0.95 * aim) << target / error;
  }
}

// The errors of equal cells fall as predicted, so the first decision predicts the total.
TEST(SampleRoundsTest, FirstRoundPredictsTheTotal) {
  const Course course = RunToTheEnd(Target(1e-3), std::vector<double>(1000, 1.0), kRatePrior);
  const double pixel_count = 1000.0 * kTilePixels;
  const double expected =
      static_cast<double>(course.records.front().sample_count_expected) / pixel_count;
  EXPECT_NEAR(expected / MeanSamples(course), 1, 0.05);
  EXPECT_EQ(static_cast<double>(course.records.back().sample_count_expected) / pixel_count,
            MeanSamples(course));
  // With another rate, the second decision predicts the total.
  const Course slower = RunToTheEnd(Target(1e-3), std::vector<double>(1000, 1.0));
  const double second = static_cast<double>(slower.records[1].sample_count_expected) / pixel_count;
  EXPECT_NEAR(second / MeanSamples(slower), 1, 0.05);
}

// In the first test, a few pixels of uncertain error may put the bound far above the estimate. With
// more samples it comes closer. A round that aimed at the present distance would overshoot by far.
TEST(SampleRoundsTest, PredictsTheShrinkingBound) {
  std::vector<CellRound> cells = UnequalCells();
  for (CellRound& cell : cells) cell.error.square_sum *= 2000;
  const double target = SumOf(cells).RelativeMse() / 3;
  const RoundDecision decision = DecideRound(Target(target), kSamplesMax, 0, cells, {}, {});
  EXPECT_GT(decision.relative_mse_upper, 1.25 * decision.relative_mse);
  EXPECT_LT(decision.predicted_relative_mse, 0.9 * target);
  EXPECT_GT(decision.predicted_relative_mse, 0.78 * target);
}

// With normal noise the distance between bound and estimate does not shrink.
TEST(SampleRoundsTest, EqualPixelsKeepTheirDeviation) {
  const CellRound now = CellAt(1, kReplicateCount);
  const ErrorSums next = ForeseeError(now, 4 * kReplicateCount, 1.2);
  EXPECT_DOUBLE_EQ(next.RelativeMse(), now.error.RelativeMse() * std::pow(4, -1.2));
  EXPECT_DOUBLE_EQ(next.Deviation() / next.RelativeMse(),
                   now.error.Deviation() / now.error.RelativeMse());
}

TEST(SampleRoundsTest, FasterRatesAreMeasured) {
  // 1 / n^1.5 = 1e-4 at 464 samples; with a rate of 1 the frame would get 1000 and more.
  const Course run = RunToTheEnd(Target(1e-4), std::vector<double>(1000, 1.0), 1.5);
  EXPECT_EQ(run.last.reason, StopReason::kTargetError);
  EXPECT_GE(MeanSamples(run), 464);
  EXPECT_LE(MeanSamples(run), 530);
}

// For an error E, the least sum of samples is (sum sqrt(k))^2 / E over cells with the error k / n.
TEST(SampleRoundsTest, SamplesGoToTheLargestGain) {
  std::vector<double> ks;
  for (int i = 0; i < 500; ++i) {
    ks.push_back(i % 2 == 0 ? 16.0 : 1.0);
  }
  constexpr double kTarget = 0.002;
  const Course run = RunToTheEnd(Target(kTarget), ks);
  const double least = std::pow((4.0 + 1.0) / 2, 2) / kTarget;
  const double evenly = (16.0 + 1.0) / 2 / kTarget;
  EXPECT_NEAR(MeanSamples(run) / BoundOverError(run) / least, 1.05, 0.05);
  EXPECT_LT(MeanSamples(run), evenly / 1.2);
  double sums[2] = {};  // By kind; each cell is within a step of its ideal number.
  for (size_t i = 0; i < ks.size(); ++i) sums[i % 2] += static_cast<double>(run.samples[i]);
  EXPECT_NEAR(sums[0] / sums[1], 4, 0.3);
}

TEST(SampleRoundsTest, ConvergedTilesKeepBeingSampled) {
  std::vector<double> ks(100, 1.0);
  ks[7] = 0;
  const Course run = RunToTheEnd(Target(1e-3), ks);
  // A tenth of the others' samples, for a hundredth of their error.
  EXPECT_GE(run.samples[7], 80u);
  EXPECT_LE(run.samples[7], 130u);
}

TEST(SampleRoundsTest, EasyFramesHaveOneRound) {
  const Course run = RunToTheEnd(Target(0.5), std::vector<double>(10, 1.0));
  EXPECT_EQ(run.round_count, 1);
  EXPECT_EQ(run.last.reason, StopReason::kTargetError);
  EXPECT_EQ(run.samples, std::vector<uint64_t>(10, uint64_t{kReplicateCount}));
}

TEST(SampleRoundsTest, BlackFramesStop) {
  const Course run = RunToTheEnd(Target(1e-3), std::vector<double>(10, 0.0));
  EXPECT_EQ(MeanSamples(run), kLookSamplesMax);
  EXPECT_EQ(run.round_count, 3);
}

TEST(SampleRoundsTest, StopsAtTheSampleLimit) {
  const Course run = RunToTheEnd(Target(1e-9), std::vector<double>(10, 1.0), 1, 100);
  EXPECT_EQ(run.last.reason, StopReason::kSamples);
  EXPECT_EQ(run.samples, std::vector<uint64_t>(10, 100));
  EXPECT_GT(run.last.relative_mse_upper, 1e-9);
}

// A single pixel with all of the error may be luck, so the bound is far above the estimate.
TEST(SampleRoundsTest, ErrorsOfFewPixelsAreNotTrusted) {
  std::vector<CellRound> cells(100, CellAt(1e-6, 64));
  cells[3].error = {kTilePixels, 1.0, 1.0};
  const RoundDecision decision = DecideRound(Target(1e-4), kSamplesMax, 0, cells, {}, {});
  EXPECT_LT(decision.relative_mse, 5e-5);
  EXPECT_GT(decision.relative_mse_upper, 1e-4);
  EXPECT_FALSE(decision.samples.empty());
}

TEST(SampleRoundsTest, EveryRoundTestsMoreStrictly) {
  const std::vector<CellRound> cells(10, CellAt(1, 64));
  double last = 0;
  for (int round = 0; round < 20; ++round) {
    const double upper =
        DecideRound(Target(1e-9), kSamplesMax, round, cells, {}, {}).relative_mse_upper;
    EXPECT_GT(upper, last);
    last = upper;
  }
}

// A finished frame continues as if the smaller target had been set from the beginning.
TEST(SampleRoundsTest, RefinementMatchesAnUninterruptedRun) {
  std::vector<double> ks;
  for (int i = 0; i < 200; ++i) ks.push_back(1 + i % 7);
  for (const double first : {0.5, 0.1, 0.02, 0.004}) {
    Course course = RunToTheEnd(Target(first), ks);
    ASSERT_EQ(course.last.reason, StopReason::kTargetError);
    std::vector<RoundRecord> rounds = course.records;
    const Course at_once = RunToTheEnd(Target(0.001), ks);
    ASSERT_TRUE(ReplayRounds(Target(0.001), kSamplesMax, &rounds));
    EXPECT_LE(rounds.size(), course.records.size());
    ASSERT_LT(rounds.size(), at_once.records.size());
    EXPECT_EQ(rounds.back().samples_next, at_once.records[rounds.size() - 1].samples_next);
  }
}

TEST(SampleRoundsTest, ConvergedFramesAreNotRefined) {
  std::vector<RoundRecord> rounds = RunToTheEnd(Target(0.01), {1, 2, 3}).records;
  EXPECT_FALSE(ReplayRounds(Target(0.01), kSamplesMax, &rounds));
  EXPECT_FALSE(ReplayRounds(Target(0.3), kSamplesMax, &rounds));
}

TEST(SampleRoundsTest, TimeAndBudgetLimitARound) {
  const std::vector<CellRound> cells(10, CellAt(1, 64));
  const double now = 10.0 * kTilePixels * 64;
  StopRule rule = Target(1e-9);
  rule.time_max = absl::Seconds(10);
  const RoundDecision some =
      DecideRound(rule, kSamplesMax, 0, cells, {}, {.time = 2 * now, .cpu = 3 * now});
  ASSERT_EQ(some.samples.size(), cells.size());
  for (const uint64_t samples : some.samples) EXPECT_EQ(samples, 128u);
  const RoundDecision none =
      DecideRound(rule, kSamplesMax, 0, cells, {}, {.time = 3 * now, .cpu = 1.01 * now});
  EXPECT_TRUE(none.samples.empty());
  EXPECT_EQ(none.reason, StopReason::kCpu);
  const RoundDecision late = DecideRound(rule, kSamplesMax, 0, cells, {}, {.time = 0.5 * now});
  EXPECT_TRUE(late.samples.empty());
  EXPECT_EQ(late.reason, StopReason::kTime);
}

TEST(SampleRoundsTest, SamplesAreAdaptiveWithoutATarget) {
  std::vector<CellRound> cells(10, CellAt(1, 64));
  cells[0] = CellAt(4, 64);
  StopRule rule;
  rule.cpu_max = absl::Hours(1);
  const double now = 10.0 * kTilePixels * 64;
  const RoundDecision decision = DecideRound(rule, kSamplesMax, 0, cells, {}, {.cpu = 3 * now});
  ASSERT_EQ(decision.samples.size(), cells.size());
  EXPECT_GT(decision.samples[0], decision.samples[1]);
}

}  // namespace
}  // namespace sheaf::coordinator
