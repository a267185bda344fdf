// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/refinement_price.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "common/base/check.h"

namespace sheaf::coordinator {
namespace {

// Log-normal deviation of the CPU time for the same work: processors share caches, memory and
// clocks.
constexpr double kCpuLogDeviation = 0.1;
// Decisions that differ by less than this fraction of all samples count as the same.
constexpr double kSameFraction = 0.05;

// The indices of the cells in each group, which are priced together; no group is empty.
using Groups = std::vector<std::vector<size_t>>;

// Puts cells with the same samples and errors into one group.
Groups GroupCells(const std::vector<CellRound>& cells) {
  std::vector<size_t> order(cells.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return std::pair(cells[a].samples, cells[a].error.RelativeMse()) <
           std::pair(cells[b].samples, cells[b].error.RelativeMse());
  });
  const size_t count = std::min(kPriceGroupsMax, cells.size());
  Groups groups(count);
  for (size_t i = 0; i < order.size(); ++i) groups[i * count / order.size()].push_back(order[i]);
  return groups;
}

// Mean over the group's pixels.
uint64_t MeanSamples(const std::vector<size_t>& group, const std::vector<CellRound>& cells,
                     const std::vector<uint64_t>& samples) {
  double sum = 0, pixel_count = 0;
  for (const size_t cell : group) {
    const double pixels = std::max(1.0, static_cast<double>(cells[cell].error.pixel_count));
    sum += pixels * static_cast<double>(samples[cell]);
    pixel_count += pixels;
  }
  return std::max<uint64_t>(1, static_cast<uint64_t>(std::lround(sum / pixel_count)));
}

RoundRecord Grouped(const RoundRecord& round, const Groups& groups) {
  std::vector<uint64_t> samples;
  for (const CellRound& cell : round.cells) samples.push_back(cell.samples);
  RoundRecord grouped;
  grouped.round = round.round;
  for (const std::vector<size_t>& group : groups) {
    CellRound& sum = grouped.cells.emplace_back();
    sum.samples = MeanSamples(group, round.cells, samples);
    for (const size_t cell : group) sum.error.Add(round.cells[cell].error);
    if (round.samples_next.empty()) continue;
    grouped.samples_next.push_back(MeanSamples(group, round.cells, round.samples_next));
  }
  return grouped;
}

// The same frame with groups in place of cells.
FinishedFrame Grouped(const FinishedFrame& frame) {
  const Groups groups = GroupCells(frame.rounds.back().cells);
  FinishedFrame grouped{frame.had_rule, frame.first_round_samples, {}, {}, frame.cpu_seconds};
  for (const RoundRecord& round : frame.rounds) {
    grouped.rounds.push_back(Grouped(round, groups));
  }
  if (frame.cpu_seconds_of_cells.empty()) return grouped;
  for (const std::vector<size_t>& group : groups) {
    double& sum = grouped.cpu_seconds_of_cells.emplace_back(0);
    for (const size_t cell : group) sum += frame.cpu_seconds_of_cells[cell];
  }
  return grouped;
}

// Combines the rate b measured between the first and the last round with its prior, by their
// precisions.
void FitRate(const std::vector<RoundRecord>& rounds, ErrorModel* model) {
  model->rate = kRatePrior;
  model->rate_deviation = kRatePriorDeviation;
  const std::vector<CellRound>& first = rounds.front().cells;
  const std::vector<CellRound>& last = rounds.back().cells;
  const double growth = PixelSamples(last) / PixelSamples(first);
  const ErrorSums early = SumOf(first), late = SumOf(last);
  if (growth <= 1 || early.sum <= 0 || late.sum <= 0) return;
  const double deviation =
      std::hypot(early.Deviation() / early.RelativeMse(), late.Deviation() / late.RelativeMse()) /
      std::log(growth);
  const double seen = 1 / (deviation * deviation);
  const double expected = 1 / (kRatePriorDeviation * kRatePriorDeviation);
  model->rate = (MeasureRate(last, first) * seen + kRatePrior * expected) / (seen + expected);
  model->rate_deviation = 1 / std::sqrt(seen + expected);
}

ErrorModel ModelOf(const FinishedFrame& frame) {
  const std::vector<CellRound>& last = frame.rounds.back().cells;
  const ErrorSums sum = SumOf(last);
  ErrorModel model;
  if (sum.sum > 0) model.log_error_deviation = sum.Deviation() / sum.RelativeMse();
  FitRate(frame.rounds, &model);
  const bool kept = !frame.cpu_seconds_of_cells.empty();
  const double cpu_seconds_per_sample = frame.cpu_seconds / PixelSamples(last);
  for (size_t i = 0; i < last.size(); ++i) {
    const auto pixels = static_cast<double>(last[i].error.pixel_count);
    const auto samples = static_cast<double>(last[i].samples);
    ForecastCell cell{last[i], cpu_seconds_per_sample * pixels, kept ? last[i].samples : 0};
    if (kept) cell.cpu_seconds_per_sample = frame.cpu_seconds_of_cells[i] / samples;
    model.cells.push_back(cell);
  }
  return model;
}

bool NearlySame(const std::vector<uint64_t>& samples, const RoundRecord& round) {
  if (samples.empty() || round.samples_next.empty()) return false;
  double difference = 0, sum = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    const auto pixels = static_cast<double>(round.cells[i].error.pixel_count);
    const auto was = static_cast<double>(round.samples_next[i]);
    difference += pixels * std::abs(static_cast<double>(samples[i]) - was);
    sum += pixels * was;
  }
  return difference <= kSameFraction * sum;
}

// The state from which the frame continues; none if it has reached the target.
std::optional<ForecastStart> StartOf(const FinishedFrame& frame, const StopRule& rule,
                                     uint64_t samples_max) {
  const size_t first = frame.had_rule ? 0 : frame.rounds.size() - 1;
  std::span<const CellRound> before;
  for (size_t i = first; i < frame.rounds.size(); ++i) {
    const RoundRecord& record = frame.rounds[i];
    const int round = static_cast<int>(i - first);
    RoundDecision decision = DecideRound(rule, samples_max, round, record.cells, before, {});
    if (decision.samples.empty()) return std::nullopt;
    if (!NearlySame(decision.samples, record)) {
      return ForecastStart{round + 1, std::move(decision.samples), record.cells};
    }
    before = record.cells;
  }
  return std::nullopt;
}

// The forecast for a frame that needs no further samples.
Forecast AsItIs(const FinishedFrame& frame, double target_error) {
  const std::vector<CellRound>& last = frame.rounds.back().cells;
  const ErrorSums sum = SumOf(last);
  Forecast forecast;
  forecast.relative_mse = sum.RelativeMse();
  forecast.reached = forecast.relative_mse <= target_error;
  forecast.samples = PixelSamples(last) / static_cast<double>(sum.pixel_count);
  return forecast;
}

// Pixel samples to render, in addition to the existing ones.
double SamplesMore(const FinishedFrame& frame, const Forecast& forecast) {
  if (forecast.cpu_seconds <= 0) return 0;
  const std::vector<CellRound>& last = frame.rounds.back().cells;
  const double kept = frame.cpu_seconds_of_cells.empty() ? 0 : PixelSamples(last);
  return forecast.samples * static_cast<double>(SumOf(last).pixel_count) - kept;
}

// A frame of groups, and its model.
using ModelledFrame = std::pair<FinishedFrame, ErrorModel>;

RefinementPrice PriceOf(const std::vector<ModelledFrame>& frames, size_t frame_count,
                        double target_error, uint64_t samples_max, int32_t priority,
                        const FarmLoad& load) {
  // The ends of the band and its middle, in the order low, value, high.
  constexpr double kDeviations[] = {-kBandDeviations, 0, kBandDeviations};
  double errors[3] = {}, samples[3] = {}, cpu_seconds[3] = {};
  double samples_more = 0;  // Summed over all pixels.
  RefinementPrice price;
  price.target_error = target_error;
  price.reached = true;
  for (const auto& [frame, model] : frames) {
    StopRule rule{.target_error = target_error};
    rule.first_round_samples = frame.first_round_samples;
    const std::optional<ForecastStart> start = StartOf(frame, rule, samples_max);
    for (size_t i = 0; i < 3; ++i) {
      const Forecast forecast = start
                                    ? ForecastFrom(model, rule, samples_max, *start, kDeviations[i])
                                    : AsItIs(frame, target_error);
      errors[i] += forecast.relative_mse;
      samples[i] += forecast.samples;
      cpu_seconds[i] += forecast.cpu_seconds;
      if (i != 1) continue;
      price.reached &= forecast.reached;
      samples_more += SamplesMore(frame, forecast);
    }
  }
  const auto count = static_cast<double>(frames.size());
  const double scale = static_cast<double>(frame_count) / count;
  price.relative_mse = WithBand(errors[1] / count, errors[0] / count, errors[2] / count, 0);
  price.samples_per_pixel = WithBand(samples[1] / count, samples[0] / count, samples[2] / count, 0);
  price.cpu_seconds = WithBand(scale * cpu_seconds[1], scale * cpu_seconds[0],
                               scale * cpu_seconds[2], kCpuLogDeviation);
  if (load.threads_used > 0) {
    price.wall_seconds = WallSeconds(price.cpu_seconds, scale * samples_more, priority, load);
  }
  return price;
}

}  // namespace

std::vector<RefinementPrice> PriceRefinement(std::span<const FinishedFrame> frames,
                                             size_t frame_count,
                                             std::span<const double> target_errors,
                                             uint64_t samples_max, int32_t priority,
                                             const FarmLoad& load) {
  SHEAF_CHECK(!frames.empty());
  std::vector<ModelledFrame> modelled;
  for (const FinishedFrame& frame : frames) {
    FinishedFrame grouped = Grouped(frame);
    ErrorModel model = ModelOf(grouped);
    modelled.emplace_back(std::move(grouped), std::move(model));
  }
  std::vector<RefinementPrice> prices;
  for (const double target : target_errors) {
    prices.push_back(PriceOf(modelled, frame_count, target, samples_max, priority, load));
  }
  return prices;
}

}  // namespace sheaf::coordinator
