// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/cost_forecast.h"

#include <cmath>

#include "common/base/check.h"

namespace sheaf::coordinator {
namespace {

// A tile as the model has it at `samples`.
TileRound TileAt(const ErrorModel& model, const ForecastTile& tile, uint64_t samples,
                 double deviations) {
  const TileRound& measured = tile.measured;
  const double log_growth =
      std::log(static_cast<double>(samples) / static_cast<double>(measured.samples));
  // Independent: the error where it was measured, and how it falls from there.
  const double log_error = std::hypot(model.log_error_deviation, log_growth * model.rate_deviation);
  const double factor = std::exp(deviations * log_error - model.rate * log_growth);
  return {samples,
          {measured.error.pixel_count, measured.error.sum * factor,
           measured.error.square_sum * factor * factor}};
}

std::vector<TileRound> TilesAt(const ErrorModel& model, const std::vector<uint64_t>& samples,
                               double deviations) {
  std::vector<TileRound> tiles;
  tiles.reserve(model.tiles.size());
  for (size_t i = 0; i < model.tiles.size(); ++i) {
    tiles.push_back(TileAt(model, model.tiles[i], samples[i], deviations));
  }
  return tiles;
}

Forecast Account(const ErrorModel& model, std::span<const TileRound> tiles) {
  Forecast forecast;
  double pixel_samples = 0;
  ErrorSums sum;
  for (size_t i = 0; i < tiles.size(); ++i) {
    const auto samples = static_cast<double>(tiles[i].samples);
    pixel_samples += static_cast<double>(tiles[i].error.pixel_count) * samples;
    forecast.cpu_seconds += model.tiles[i].cpu_seconds_per_sample * samples;
    sum.Add(tiles[i].error);
  }
  forecast.samples = pixel_samples / static_cast<double>(sum.pixel_count);
  forecast.relative_mse = sum.RelativeMse();
  return forecast;
}

Forecast PlayRounds(const ErrorModel& model, const StopRule& rule, uint64_t samples_max,
                    std::vector<uint64_t> samples, double deviations) {
  SHEAF_CHECK(!model.tiles.empty() && rule.target_error > 0);
  std::vector<TileRound> before;
  for (int round = 0;; ++round) {
    std::vector<TileRound> tiles = TilesAt(model, samples, deviations);
    const RoundDecision decision = DecideRound(rule, samples_max, round, tiles, before, {});
    if (decision.samples.empty()) {
      Forecast forecast = Account(model, tiles);
      forecast.target_error = rule.target_error;
      forecast.reached = decision.reason == StopReason::kTargetError;
      forecast.round_count = round + 1;
      return forecast;
    }
    samples = decision.samples;
    before = std::move(tiles);
  }
}

}  // namespace

Forecast ForecastTarget(const ErrorModel& model, const StopRule& rule, uint64_t samples_max,
                        double deviations) {
  const uint64_t first = std::min(samples_max, rule.first_round_samples);
  return PlayRounds(model, rule, samples_max, std::vector<uint64_t>(model.tiles.size(), first),
                    deviations);
}

Forecast ForecastSamples(const ErrorModel& model, uint64_t samples, double deviations) {
  const std::vector<uint64_t> all(model.tiles.size(), samples);
  return Account(model, TilesAt(model, all, deviations));
}

}  // namespace sheaf::coordinator
