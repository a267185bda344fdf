// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/cost_forecast.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "common/base/check.h"
#include "common/math/normal_distribution.h"

namespace sheaf::coordinator {
namespace {

// Number of simulations of a frame's rounds if silhouettes make them random.
constexpr uint64_t kPlays = 9;

// The model's errors of a cell at `samples`, without those of silhouettes.
ErrorSums ErrorAt(const ErrorModel& model, const ForecastCell& cell, uint64_t samples,
                  double deviations) {
  const CellRound& measured = cell.measured;
  const double log_growth =
      std::log(static_cast<double>(samples) / static_cast<double>(measured.samples));
  // Two independent uncertainties: the measured error, and how it falls from there.
  const double log_error = std::hypot(model.log_error_deviation, log_growth * model.rate_deviation);
  const double factor = std::exp(deviations * log_error);
  ErrorSums error = ForeseeError(measured, static_cast<double>(samples), model.rate);
  error.sum *= factor;
  error.square_sum *= factor * factor;
  return error;
}

// Adds the model's errors of `passes` light passes.
void AddLightErrors(const LightModel& light, uint64_t passes, double deviations,
                    std::vector<ErrorSums>* errors) {
  constexpr double kRate = 1;
  const double factor = std::exp(deviations * light.log_error_deviation);
  for (size_t i = 0; i < errors->size(); ++i) {
    ErrorSums of_light =
        ForeseeError({light.passes, light.errors[i]}, static_cast<double>(passes), kRate);
    of_light.sum *= factor;
    of_light.square_sum *= factor * factor;
    (*errors)[i] = AddIndependent((*errors)[i], of_light);
  }
}

std::vector<CellRound> CellsAt(const ErrorModel& model, const std::vector<uint64_t>& samples,
                               double deviations, std::mt19937_64* random) {
  std::vector<ErrorSums> errors;
  for (size_t i = 0; i < model.cells.size(); ++i) {
    errors.push_back(ErrorAt(model, model.cells[i], samples[i], deviations));
  }
  if (!model.silhouettes.empty()) model.silhouettes.AddErrors(samples, deviations, random, &errors);
  if (model.light.passes > 0) {
    AddLightErrors(model.light, std::ranges::max(samples), deviations, &errors);
  }
  std::vector<CellRound> cells;
  for (size_t i = 0; i < samples.size(); ++i) cells.push_back({samples[i], errors[i]});
  return cells;
}

Forecast Account(const ErrorModel& model, std::span<const CellRound> cells) {
  Forecast forecast;
  double pixel_samples = 0;
  uint64_t passes = 0;
  ErrorSums sum;
  for (size_t i = 0; i < cells.size(); ++i) {
    const auto samples = static_cast<double>(cells[i].samples);
    pixel_samples += static_cast<double>(cells[i].error.pixel_count) * samples;
    const auto kept = static_cast<double>(model.cells[i].samples_kept);
    forecast.cpu_seconds += model.cells[i].cpu_seconds_per_sample * std::max(0.0, samples - kept);
    sum.Add(cells[i].error);
    if (model.light.passes > 0) passes = std::max(passes, cells[i].samples);
  }
  forecast.light_passes = static_cast<double>(passes);
  const auto kept = static_cast<double>(model.light.passes_kept);
  forecast.cpu_seconds +=
      model.light.cpu_seconds_per_pass * std::max(0.0, forecast.light_passes - kept);
  if (forecast.cpu_seconds > 0) forecast.cpu_seconds += model.training_cpu_seconds;
  forecast.samples = pixel_samples / static_cast<double>(sum.pixel_count);
  forecast.relative_mse = sum.RelativeMse();
  return forecast;
}

Forecast PlayRounds(const ErrorModel& model, const StopRule& rule, uint64_t samples_max,
                    ForecastStart start, double deviations, std::mt19937_64* random) {
  std::vector<CellRound> before = std::move(start.before);
  for (int round = start.round;; ++round) {
    std::vector<CellRound> cells = CellsAt(model, start.samples, deviations, random);
    const RoundDecision decision = DecideRound(rule, samples_max, round, cells, before, {});
    if (decision.samples.empty()) {
      Forecast forecast = Account(model, cells);
      forecast.target_error = rule.target_error;
      forecast.reached = decision.reason == StopReason::kTargetError;
      forecast.round_count = round + 1;
      return forecast;
    }
    start.samples = decision.samples;
    before = std::move(cells);
  }
}

}  // namespace

Estimate WithBand(double value, double low, double high, double log_deviation) {
  if (!(value > 0)) return {};
  const double more = kBandDeviations * log_deviation;
  const double down = low > 0 ? std::hypot(std::log(value / std::min(low, value)), more)
                              : std::numeric_limits<double>::infinity();
  const double up = std::hypot(std::log(std::max(high, value) / value), more);
  return {value, value * std::exp(-down), value * std::exp(up)};
}

ErrorSums AddIndependent(const ErrorSums& a, const ErrorSums& b) {
  // The product of the two errors of a pixel: that of their means, where the two are unrelated.
  const double product =
      a.pixel_count == 0 ? 0 : a.sum * b.sum / static_cast<double>(a.pixel_count);
  return {a.pixel_count, a.sum + b.sum, a.square_sum + b.square_sum + 2 * product};
}

Forecast ForecastFrom(const ErrorModel& model, const StopRule& rule, uint64_t samples_max,
                      ForecastStart start, double deviations) {
  SHEAF_CHECK(!model.cells.empty() && model.cells.size() == start.samples.size() &&
              rule.target_error > 0);
  if (model.silhouettes.empty()) {
    return PlayRounds(model, rule, samples_max, std::move(start), deviations, nullptr);
  }
  // Each round meets random pixels of the silhouettes, and a frame stops at the first round that is
  // lucky, so the expected errors of rounds do not predict when it stops.
  std::vector<Forecast> plays;
  for (uint64_t seed = 0; seed < kPlays; ++seed) {
    std::mt19937_64 random(seed);
    plays.push_back(PlayRounds(model, rule, samples_max, start, deviations, &random));
  }
  std::ranges::sort(plays, {}, &Forecast::cpu_seconds);
  const double fraction = NormalCdf(deviations);
  return plays[static_cast<size_t>(std::lround(fraction * (kPlays - 1)))];
}

Forecast ForecastTarget(const ErrorModel& model, const StopRule& rule, uint64_t samples_max,
                        double deviations) {
  const uint64_t first = std::min(samples_max, rule.first_round_samples);
  ForecastStart start;
  for (const ForecastCell& cell : model.cells) {
    start.samples.push_back(std::max(first, cell.samples_kept));
  }
  return ForecastFrom(model, rule, samples_max, std::move(start), deviations);
}

Forecast ForecastSamples(const ErrorModel& model, uint64_t samples, double deviations) {
  const std::vector<uint64_t> all(model.cells.size(), samples);
  return Account(model, CellsAt(model, all, deviations, nullptr));
}

}  // namespace sheaf::coordinator
