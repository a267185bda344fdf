// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/cost_forecast.h"

#include <cmath>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr int64_t kTilePixels = 1024;
constexpr uint64_t kSamplesMax = 1 << 20;

// A cell measured at 16 samples, with the same error in every pixel.
ForecastCell CellOf(double error, double cpu_seconds_per_sample = 1e-3) {
  const auto count = static_cast<double>(kTilePixels);
  return {{kReplicateCount, {kTilePixels, count * error, count * error * error}},
          cpu_seconds_per_sample};
}

TEST(CostForecastTest, EasyTargetsCostTheFirstRound) {
  const ErrorModel model{{CellOf(1e-3), CellOf(2e-3, 3e-3)}};
  const Forecast forecast = ForecastTarget(model, {.target_error = 0.2}, kSamplesMax);
  EXPECT_TRUE(forecast.reached);
  EXPECT_EQ(forecast.round_count, 1);
  EXPECT_DOUBLE_EQ(forecast.samples, 16);
  EXPECT_DOUBLE_EQ(forecast.cpu_seconds, 16 * 4e-3);
  EXPECT_DOUBLE_EQ(forecast.relative_mse, 1.5e-3);
  // A smaller target asks for a second look at so few pixels.
  EXPECT_EQ(ForecastTarget(model, {.target_error = 0.01}, kSamplesMax).samples, 80);
}

// An error of 0.16 / (n / 16)^b reaches 0.01 with 16^(1 / b) times the samples, plus some for the
// confidence.
TEST(CostForecastTest, EqualTilesFollowTheRate) {
  for (const double rate : {1.0, 1.3}) {
    ErrorModel model{std::vector<ForecastCell>(100, CellOf(0.16)), rate};
    const Forecast forecast = ForecastTarget(model, {.target_error = 0.01}, kSamplesMax);
    EXPECT_TRUE(forecast.reached);
    const double least = 16 * std::pow(16, 1 / rate);
    EXPECT_GE(forecast.samples, least);
    EXPECT_LE(forecast.samples, 1.2 * least);
    EXPECT_NEAR(forecast.cpu_seconds, 100 * 1e-3 * forecast.samples, 1e-6);
    EXPECT_LE(forecast.relative_mse, 0.01);
  }
}

TEST(CostForecastTest, CostCountsTheSampledTiles) {
  // Half of the cells are done after the first round; their samples cost ten times as much.
  ErrorModel model;
  for (int i = 0; i < 50; ++i) {
    model.cells.push_back(CellOf(1e-6, 1e-2));
    model.cells.push_back(CellOf(0.32, 1e-3));
  }
  const Forecast forecast = ForecastTarget(model, {.target_error = 0.01}, kSamplesMax);
  const double noisy_samples = (2 * forecast.samples - 16);
  EXPECT_LT(forecast.cpu_seconds, 50 * (1e-2 * 40 + 1e-3 * noisy_samples));
}

TEST(CostForecastTest, DeviationsBoundTheCost) {
  // The cells are unequal, since equal ones would all take the next step of sixteen samples at
  // once.
  ErrorModel model{{}, 1.0, 0.2, 0.05};
  for (int i = 0; i < 100; ++i) model.cells.push_back(CellOf(0.16 * std::exp(0.3 * std::sin(i))));
  const StopRule rule{.target_error = 0.01};
  const double low = ForecastTarget(model, rule, kSamplesMax, -1.28).cpu_seconds;
  const double middle = ForecastTarget(model, rule, kSamplesMax).cpu_seconds;
  const double high = ForecastTarget(model, rule, kSamplesMax, 1.28).cpu_seconds;
  // At 16 times the samples, the deviation of b contributes ln 16 * 0.05 = 0.14 beside the 0.2.
  EXPECT_NEAR(std::log(high / middle), 1.28 * std::hypot(0.2, 0.139), 0.06);
  EXPECT_NEAR(std::log(middle / low), 1.28 * std::hypot(0.2, 0.139), 0.06);
}

TEST(CostForecastTest, ExistingSamplesAreFreeAndStartTheFirstRound) {
  ErrorModel model{std::vector<ForecastCell>(100, CellOf(0.16))};
  for (ForecastCell& cell : model.cells) cell.samples_kept = 64;
  const Forecast forecast = ForecastTarget(model, {.target_error = 0.01}, kSamplesMax);
  EXPECT_TRUE(forecast.reached);
  EXPECT_NEAR(forecast.cpu_seconds, 100 * 1e-3 * (forecast.samples - 64), 1e-6);
  const Forecast done = ForecastTarget(model, {.target_error = 0.1}, kSamplesMax);
  EXPECT_EQ(done.round_count, 1);
  EXPECT_DOUBLE_EQ(done.samples, 64);
  EXPECT_DOUBLE_EQ(done.cpu_seconds, 0);
  EXPECT_NEAR(done.relative_mse, 0.16 / 4, 1e-12);
}

// Light passes of a frame in which each cell has the error `error` at 16 passes.
LightModel LightOf(size_t cell_count, double error, double cpu_seconds_per_pass) {
  LightModel light{kReplicateCount, {}, 0, cpu_seconds_per_pass, 0};
  light.errors.assign(cell_count, CellOf(error).measured.error);
  return light;
}

// Without light passes the camera's cells would be done after the first round.
TEST(CostForecastTest, LightPassesAddErrorsAndCosts) {
  ErrorModel model{std::vector<ForecastCell>(100, CellOf(1e-3))};
  model.light = LightOf(100, 0.16, 0.5);
  const Forecast given = ForecastSamples(model, 64);
  EXPECT_NEAR(given.relative_mse, 1e-3 / 4 + 0.16 / 4, 1e-9);
  EXPECT_EQ(given.light_passes, 64);
  EXPECT_NEAR(given.cpu_seconds, 64 * (100 * 1e-3 + 0.5), 1e-9);
  const Forecast forecast = ForecastTarget(model, {.target_error = 0.01}, kSamplesMax);
  EXPECT_TRUE(forecast.reached);
  EXPECT_GE(forecast.light_passes, 16 * 16);
  EXPECT_LE(forecast.light_passes, 1.2 * 16 * 17);
  EXPECT_NEAR(forecast.cpu_seconds, 100 * 1e-3 * forecast.samples + 0.5 * forecast.light_passes,
              1e-6);
}

// There are as many passes as the cell with the most samples has.
TEST(CostForecastTest, TheNoisiestCellDecidesTheLightPasses) {
  ErrorModel model{std::vector<ForecastCell>(50, CellOf(1e-6))};
  for (int i = 0; i < 50; ++i) model.cells.push_back(CellOf(0.32));
  model.light = LightOf(100, 1e-6, 0.5);
  const Forecast forecast = ForecastTarget(model, {.target_error = 0.01}, kSamplesMax);
  const double noisy_samples = 2 * forecast.samples - 16;  // The mean of the noisy half.
  EXPECT_GE(forecast.light_passes, noisy_samples);
  EXPECT_LE(forecast.light_passes, 1.2 * noisy_samples);
}

TEST(CostForecastTest, TrainingsCostOnce) {
  ErrorModel model{{CellOf(0.16)}};
  const double without = ForecastSamples(model, 64).cpu_seconds;
  model.training_cpu_seconds = 7;
  EXPECT_DOUBLE_EQ(ForecastSamples(model, 64).cpu_seconds, without + 7);
  model.cells[0].samples_kept = 64;
  EXPECT_EQ(ForecastSamples(model, 64).cpu_seconds, 0);  // Nothing is rendered.
}

// Pixels with the errors a and b: the square of the sum, pixel by pixel.
TEST(CostForecastTest, IndependentErrorsAdd) {
  const ErrorSums sum = AddIndependent(CellOf(0.1).measured.error, CellOf(0.3).measured.error);
  const ErrorSums expected = CellOf(0.4).measured.error;
  EXPECT_EQ(sum.pixel_count, expected.pixel_count);
  EXPECT_NEAR(sum.sum, expected.sum, 1e-9);
  EXPECT_NEAR(sum.square_sum, expected.square_sum, 1e-9);
}

TEST(CostForecastTest, ReportsUnreachableTargets) {
  const ErrorModel model{std::vector<ForecastCell>(10, CellOf(1.0))};
  const Forecast forecast = ForecastTarget(model, {.target_error = 1e-4}, 64);
  EXPECT_FALSE(forecast.reached);
  EXPECT_DOUBLE_EQ(forecast.samples, 64);
  EXPECT_NEAR(forecast.relative_mse, 0.25, 1e-9);
}

TEST(CostForecastTest, SampleCountsPredictErrors) {
  const ErrorModel model{{CellOf(0.16)}, 1.5};
  EXPECT_NEAR(ForecastSamples(model, 256).relative_mse, 0.16 / 64, 1e-12);
  EXPECT_DOUBLE_EQ(ForecastSamples(model, 256).cpu_seconds, 0.256);
}

}  // namespace
}  // namespace sheaf::coordinator
