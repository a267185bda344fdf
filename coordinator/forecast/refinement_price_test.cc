// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/refinement_price.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sheaf::coordinator {
namespace {

constexpr uint64_t kRefinedSamplesMax = uint64_t{1} << 20;
constexpr double kSecondsPerPixelSample = 1e-6;
constexpr int64_t kRefinedTilePixels = 1024;

// Cell i of a frame with unequal errors that fall as 1 / n.
CellRound CellAt(size_t i, uint64_t samples) {
  const double error = (0.1 + 0.2 * static_cast<double>(i % 10)) / static_cast<double>(samples);
  const auto pixels = static_cast<double>(kRefinedTilePixels);
  return {samples, {kRefinedTilePixels, pixels * error, 4 * pixels * error * error}};
}

double SecondsOf(const std::vector<CellRound>& cells) {
  return kSecondsPerPixelSample * PixelSamples(cells);
}

// Renders the frame in rounds, as Farm does.
FinishedFrame RenderTo(double target, size_t cell_count) {
  FinishedFrame frame;
  frame.had_rule = true;
  std::vector<uint64_t> samples(cell_count, kReplicateCount);
  std::vector<CellRound> before;
  while (!samples.empty()) {
    RoundRecord& record = frame.rounds.emplace_back();
    record.round = static_cast<int32_t>(frame.rounds.size()) - 1;
    for (size_t i = 0; i < cell_count; ++i) record.cells.push_back(CellAt(i, samples[i]));
    record.Take(DecideRound({.target_error = target}, kRefinedSamplesMax, record.round,
                            record.cells, before, {}));
    samples = record.samples_next;
    before = record.cells;
  }
  frame.cpu_seconds = SecondsOf(before);
  for (const CellRound& cell : before) frame.cpu_seconds_of_cells.push_back(SecondsOf({cell}));
  return frame;
}

RefinementPrice PriceOf(const FinishedFrame& frame, double target, double threads_used = 4) {
  return PriceRefinement({&frame, 1}, 1, {&target, 1}, kRefinedSamplesMax, 0, {threads_used, {}})
      .front();
}

class RefinementPriceTest : public ::testing::TestWithParam<size_t> {};

TEST_P(RefinementPriceTest, IsTheFullCostMinusExistingSamples) {
  const FinishedFrame loose = RenderTo(5e-3, GetParam());
  for (const double target : {2e-3, 5e-4, 1e-4}) {
    const FinishedFrame tight = RenderTo(target, GetParam());
    const double beyond = tight.cpu_seconds - loose.cpu_seconds;
    const RefinementPrice price = PriceOf(loose, target);
    EXPECT_TRUE(price.reached);
    EXPECT_NEAR(price.cpu_seconds.value, beyond, 0.15 * beyond) << target;
    EXPECT_LT(price.cpu_seconds.low, beyond);
    EXPECT_GT(price.cpu_seconds.high, beyond);
    EXPECT_LE(price.relative_mse.value, target);
    EXPECT_NEAR(price.wall_seconds->value * 4, price.cpu_seconds.value,
                0.1 * price.cpu_seconds.value);
  }
}

// The larger number of cells is priced in groups.
INSTANTIATE_TEST_SUITE_P(Cells, RefinementPriceTest, ::testing::Values(24, 1000));

TEST(RefinementPriceOfOneTest, IsZeroForConvergedFrames) {
  const FinishedFrame frame = RenderTo(1e-3, 24);
  const RefinementPrice price = PriceOf(frame, 2e-3);
  EXPECT_TRUE(price.reached);
  EXPECT_EQ(price.cpu_seconds.value, 0);
  EXPECT_EQ(price.wall_seconds->value, 0);
}

TEST(RefinementPriceOfOneTest, CountsAllSamplesWithoutParts) {
  FinishedFrame frame = RenderTo(5e-3, 24);
  frame.cpu_seconds_of_cells.clear();
  const double whole = RenderTo(1e-3, 24).cpu_seconds;
  EXPECT_NEAR(PriceOf(frame, 1e-3).cpu_seconds.value, whole, 0.15 * whole);
}

TEST(RefinementPriceOfOneTest, ContinuesFrameWithoutRounds) {
  FinishedFrame frame;
  frame.first_round_samples = 64;
  RoundRecord& end = frame.rounds.emplace_back();
  for (size_t i = 0; i < 24; ++i) end.cells.push_back(CellAt(i, 64));
  frame.cpu_seconds = SecondsOf(end.cells);
  for (const CellRound& cell : end.cells) frame.cpu_seconds_of_cells.push_back(SecondsOf({cell}));
  const double beyond = RenderTo(1e-3, 24).cpu_seconds - frame.cpu_seconds;
  const RefinementPrice price = PriceOf(frame, 1e-3, 0);
  // The prior expects errors to fall a little faster than these do.
  EXPECT_NEAR(price.cpu_seconds.value, beyond, 0.3 * beyond);
  EXPECT_GT(price.cpu_seconds.high, beyond);
  EXPECT_FALSE(price.wall_seconds.has_value());
}

TEST(RefinementPriceOfOneTest, ReportsUnreachableTargets) {
  const FinishedFrame frame = RenderTo(5e-3, 24);
  const double target = 1e-6;
  const RefinementPrice price =
      PriceRefinement({&frame, 1}, 1, {&target, 1}, 1024, 0, {4, {}}).front();
  EXPECT_FALSE(price.reached);
  EXPECT_LE(price.samples_per_pixel.value, 1024);
}

TEST(RefinementPriceOfOneTest, WaitsForOtherJobs) {
  const FinishedFrame frame = RenderTo(5e-3, 24);
  const double target = 1e-3;
  const RefinementPrice alone = PriceOf(frame, target);
  const FarmLoad busy{
      4, WorkAhead({{.priority = 1, .sample_count = 100, .cpu_seconds_per_sample = 3}})};
  const RefinementPrice later =
      PriceRefinement({&frame, 1}, 1, {&target, 1}, kRefinedSamplesMax, 0, busy).front();
  EXPECT_DOUBLE_EQ(later.cpu_seconds.value, alone.cpu_seconds.value);
  EXPECT_NEAR(later.wall_seconds->value, alone.wall_seconds->value + 300.0 / 4, 1e-9);
  const FarmLoad beside{4, WorkAhead({{.priority = 0, .sample_count = 1e9}})};
  const RefinementPrice shared =
      PriceRefinement({&frame, 1}, 1, {&target, 1}, kRefinedSamplesMax, 0, beside).front();
  EXPECT_NEAR(shared.wall_seconds->value, 2 * alone.wall_seconds->value, 1e-9);
}

TEST(RefinementPriceOfOneTest, GrowsWithTheFramesOfARange) {
  const FinishedFrame frame = RenderTo(5e-3, 24);
  const double target = 1e-3;
  const RefinementPrice one = PriceOf(frame, target);
  const std::vector<FinishedFrame> two{frame, frame};
  const RefinementPrice many =
      PriceRefinement(two, 10, {&target, 1}, kRefinedSamplesMax, 0, {4, {}}).front();
  EXPECT_NEAR(many.cpu_seconds.value, 10 * one.cpu_seconds.value, 1e-9);
  EXPECT_DOUBLE_EQ(many.samples_per_pixel.value, one.samples_per_pixel.value);
}

}  // namespace
}  // namespace sheaf::coordinator
