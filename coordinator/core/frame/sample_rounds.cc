// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/sample_rounds.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/base/check.h"
#include "common/math/golden_sequence.h"
#include "common/math/normal_distribution.h"
#include "coordinator/core/frame/certified_rounds.h"

namespace sheaf::coordinator {
namespace {

// The exponent b is at least that of independent samples; no cell is smooth enough for more than
// kRateMax.
constexpr double kRateMin = 1, kRateMax = 2;
// The rate is measured if the round should have reduced the error by at least this factor.
constexpr double kRateDropMin = 1.3;
// A cell's error counts as at least this fraction of the frame's, as rare bright samples may not
// have occurred in it yet.
constexpr double kCellFractionMin = 0.01;
// A round aims at this fraction of the target, so that it is likely the last.
constexpr double kAimFraction = 0.98;
constexpr int kBisectionSteps = 60;
// Samples are added in steps of one per replicate, or in larger steps if that is small relative to
// the samples: finer steps save less time than the additional parts cost (docs/adr/0042). With the
// largest power of two not above the number of samples, a step is half of it, up to kStepEnough,
// and beyond that kStepFraction of it.
constexpr double kStepEnough = 4 * kReplicateCount, kStepFraction = 1.0 / 8;

// Standard deviations between the estimate and the upper bound in the test after a round: a normal
// value exceeds them with the probability of a miss in this test.
double DeviationsOf(int round) {
  const double look = round + 1;
  const double miss = kMissProbability * 6 / (std::numbers::pi * std::numbers::pi * look * look);
  return -NormalQuantile(miss);
}

// The upper bound of the frame's error. deviations: from DeviationsOf.
double UpperBound(const ErrorSums& frame, double deviations) {
  return frame.RelativeMse() + deviations * frame.Deviation();
}

double StepAt(double samples) {
  const double power = std::exp2(std::floor(std::log2(samples)));
  return std::max(
      {double{kReplicateCount}, std::min(power / 2, kStepEnough), kStepFraction * power});
}

// Added to the number of steps of cell i, in [0, 1), before it is rounded down, so that among equal
// cells the right fraction is rounded up.
double Dither(size_t i) { return GoldenFraction(i); }

// The distribution of samples among cells, as a function of a scale.
class Allocation {
 public:
  Allocation(std::span<const CellRound> cells, uint64_t samples_max, double rate)
      : cells_(cells), samples_max_(samples_max), rate_(rate) {
    // Errors of a pixel at one sample, so that cells are comparable.
    double sum = 0;
    for (const CellRound& cell : cells) {
      weights_.push_back(cell.error.RelativeMse() *
                         std::pow(static_cast<double>(cell.samples), rate));
      sum += static_cast<double>(cell.error.pixel_count) * weights_.back();
    }
    const double mean = sum / static_cast<double>(SumOf(cells).pixel_count);
    for (double& weight : weights_) {
      weight = std::pow(std::max(weight, kCellFractionMin * mean), 1 / (1 + rate));
    }
  }

  // The final samples per pixel of cell i, rounded to steps.
  double Ideal(size_t i, double scale) const {
    const auto now = static_cast<double>(cells_[i].samples);
    const double ideal = scale * weights_[i];
    const auto most = static_cast<double>(samples_max_);
    if (ideal >= most) return most;
    if (ideal <= now) return now;
    const double step = StepAt(ideal);
    return std::clamp(std::floor(ideal / step + Dither(i)) * step, now, most);
  }
  // Pixel samples of the frame at their final number, regardless of the limits of a round.
  double IdealPixelSamples(double scale) const {
    double sum = 0;
    for (size_t i = 0; i < cells_.size(); ++i) {
      sum += static_cast<double>(cells_[i].error.pixel_count) * Ideal(i, scale);
    }
    return sum;
  }
  // The frame's predicted error with the final samples.
  ErrorSums Foreseen(double scale) const {
    ErrorSums sum;
    for (size_t i = 0; i < cells_.size(); ++i) sum.Add(ErrorAt(i, Ideal(i, scale)));
    return sum;
  }
  // The samples per pixel of cell i after the next round.
  uint64_t Samples(size_t i, double scale) const {
    return std::min(static_cast<uint64_t>(Ideal(i, scale)), kRoundGrowthMax * cells_[i].samples);
  }
  double PixelSamples(double scale) const {
    double sum = 0;
    for (size_t i = 0; i < cells_.size(); ++i) {
      sum +=
          static_cast<double>(cells_[i].error.pixel_count) * static_cast<double>(Samples(i, scale));
    }
    return sum;
  }
  ErrorSums ErrorAt(size_t i, double samples) const {
    return ForeseeError(cells_[i], samples, rate_);
  }
  // The scale at which all cells have samples_max.
  double ScaleMax() const {
    double scale = 0;
    for (const double weight : weights_) {
      if (weight > 0) scale = std::max(scale, static_cast<double>(samples_max_) / weight);
    }
    return scale;
  }

 private:
  std::span<const CellRound> cells_;
  const uint64_t samples_max_;
  const double rate_;
  std::vector<double> weights_;
};

// Bisection for the scale at which `fits`, which is true up to some scale in [0, high] and false
// above, changes. largest: the largest scale at which it is true; 0 if there is none. next: the
// smallest at which it is false; `high` if there is none. Samples are rounded to steps, so errors
// at the two scales may differ.
struct Scales {
  double largest = 0, next = 0;
};
template <typename Fits>
Scales FindScales(double high, const Fits& fits) {
  if (fits(high)) return {high, high};
  double low = 0;
  for (int i = 0; i < kBisectionSteps; ++i) {
    const double middle = (low + high) / 2;
    (fits(middle) ? low : high) = middle;
  }
  return {low, high};
}

// Gives more samples to cells that have fewer than `samples`, within the limits of a round. The
// frame is done if there are no such cells, or if no time is left.
void LookFurther(double samples, uint64_t samples_max, std::span<const CellRound> cells,
                 const RoundAllowance& allowance, RoundDecision* decision) {
  const auto step = double{kReplicateCount};
  const uint64_t wanted = static_cast<uint64_t>(
      std::min(static_cast<double>(samples_max), std::ceil(samples / step) * step));
  double pixel_samples = 0, final_pixel_samples = 0;
  bool grows = false;
  std::vector<uint64_t> next;
  ErrorSums predicted;
  for (const CellRound& cell : cells) {
    const auto count = static_cast<double>(cell.error.pixel_count);
    next.push_back(std::max(cell.samples, std::min(wanted, kRoundGrowthMax * cell.samples)));
    grows = grows || next.back() > cell.samples;
    pixel_samples += count * static_cast<double>(next.back());
    final_pixel_samples += count * static_cast<double>(std::max(cell.samples, wanted));
    predicted.Add(ForeseeError(cell, static_cast<double>(next.back()), kRateMin));
  }
  if (!grows) return;
  if (pixel_samples > std::min(allowance.time, allowance.cpu)) {
    decision->reason = allowance.time < allowance.cpu ? StopReason::kTime : StopReason::kCpu;
    return;
  }
  decision->samples = std::move(next);
  decision->predicted_relative_mse = predicted.RelativeMse();
  decision->sample_count_expected = static_cast<uint64_t>(final_pixel_samples);
}

}  // namespace

double SamplesToTrust(double target_error, int64_t pixel_count) {
  const double covered_pixels =
      kCoverageSeen * target_error * static_cast<double>(std::max<int64_t>(1, pixel_count));
  return std::min(kLookSamplesMax, -std::log(kMissProbability) / covered_pixels);
}

ErrorSums SumOf(std::span<const CellRound> cells) {
  ErrorSums sum;
  for (const CellRound& cell : cells) sum.Add(cell.error);
  return sum;
}

double PixelSamples(std::span<const CellRound> cells) {
  double sum = 0;
  for (const CellRound& cell : cells) {
    sum += static_cast<double>(cell.error.pixel_count) * static_cast<double>(cell.samples);
  }
  return sum;
}

ErrorSums ForeseeError(const CellRound& cell, double samples, double rate) {
  const double growth = samples / static_cast<double>(cell.samples);
  const double factor = std::pow(growth, -rate);
  const auto count = static_cast<double>(cell.error.pixel_count);
  const double sum = cell.error.sum * factor;
  const double least = count > 0 ? sum * sum / count : 0;
  return {cell.error.pixel_count, sum,
          std::max(cell.error.square_sum * factor * factor / growth, least)};
}

double MeasureRate(std::span<const CellRound> cells, std::span<const CellRound> before) {
  if (before.empty()) return kRatePrior;
  const double now = SumOf(cells).sum;
  const auto predicted = [&](double rate) {
    double sum = 0;
    for (size_t i = 0; i < cells.size(); ++i) {
      const double growth =
          static_cast<double>(cells[i].samples) / static_cast<double>(before[i].samples);
      sum += before[i].error.sum * std::pow(growth, -rate);
    }
    return sum;
  };
  if (SumOf(before).sum < kRateDropMin * predicted(kRateMin)) return kRatePrior;
  double low = kRateMin, high = kRateMax;
  for (int i = 0; i < kBisectionSteps; ++i) {
    const double middle = (low + high) / 2;
    (predicted(middle) > now ? low : high) = middle;
  }
  return (low + high) / 2;
}

RoundDecision ErrorsOfRound(int round, std::span<const CellRound> cells) {
  const ErrorSums sum = SumOf(cells);
  RoundDecision decision;
  decision.relative_mse = sum.RelativeMse();
  decision.sample_count_expected = static_cast<uint64_t>(PixelSamples(cells));
  decision.relative_mse_upper = UpperBound(sum, DeviationsOf(round));
  return decision;
}

RoundDecision DecideAfter(const RoundRecord& record, const StopRule& rule, uint64_t samples_max,
                          std::span<const CellRound> before, const RoundAllowance& allowance) {
  if (!rule.certified) {
    return DecideRound(rule, samples_max, record.round, record.cells, before, allowance);
  }
  return DecideCertifiedRound(rule, samples_max, record.round, record.certified_upper, record.cells,
                              before, allowance);
}

RoundDecision DecideRound(const StopRule& rule, uint64_t samples_max, int round,
                          std::span<const CellRound> cells, std::span<const CellRound> before,
                          const RoundAllowance& allowance) {
  SHEAF_CHECK(!cells.empty() && (before.empty() || before.size() == cells.size()));
  const ErrorSums sum = SumOf(cells);
  RoundDecision decision = ErrorsOfRound(round, cells);
  if (rule.target_error > 0 && decision.relative_mse_upper <= rule.target_error) {
    decision.reason = StopReason::kTargetError;
    LookFurther(SamplesToTrust(rule.target_error, sum.pixel_count), samples_max, cells, allowance,
                &decision);
    return decision;
  }
  const Allocation allocation(cells, samples_max, MeasureRate(cells, before));
  double scale = allocation.ScaleMax();
  if (rule.target_error > 0) {
    const double aim = kAimFraction * rule.target_error;
    const double deviations = DeviationsOf(round + 1);
    scale = FindScales(scale, [&](double s) {
              return UpperBound(allocation.Foreseen(s), deviations) > aim;
            }).next;
  }
  const double now = PixelSamples(cells);
  const double allowed = std::min(allowance.time, allowance.cpu);
  decision.sample_count_expected =
      static_cast<uint64_t>(std::max(now, std::min(allowed, allocation.IdealPixelSamples(scale))));
  const double least = now * (1 + kRoundGrowthMin);
  if (allocation.PixelSamples(scale) < least) {
    scale = FindScales(allocation.ScaleMax(), [&](double s) {
              return allocation.PixelSamples(s) <= least;
            }).next;
  }
  if (allocation.PixelSamples(scale) > allowed) {
    decision.reason = allowance.time < allowance.cpu ? StopReason::kTime : StopReason::kCpu;
    if (allowed < least) return decision;
    scale =
        FindScales(scale, [&](double s) { return allocation.PixelSamples(s) <= allowed; }).largest;
  }
  if (allocation.PixelSamples(scale) <= now) return decision;  // All cells have samples_max.
  ErrorSums next;
  for (size_t i = 0; i < cells.size(); ++i) {
    decision.samples.push_back(allocation.Samples(i, scale));
    next.Add(allocation.ErrorAt(i, static_cast<double>(decision.samples.back())));
  }
  decision.predicted_relative_mse = next.RelativeMse();
  return decision;
}

void RoundRecord::Take(RoundDecision decision) {
  relative_mse = decision.relative_mse;
  relative_mse_upper = decision.relative_mse_upper;
  predicted_relative_mse = decision.predicted_relative_mse;
  samples_next = std::move(decision.samples);
  sample_count_expected = decision.sample_count_expected;
  stop_reason = decision.reason;
}

bool ReplayRounds(const StopRule& rule, uint64_t samples_max, std::vector<RoundRecord>* rounds) {
  SHEAF_CHECK(!rounds->empty());
  std::span<const CellRound> before;
  for (size_t i = 0; i < rounds->size(); ++i) {
    RoundRecord& record = (*rounds)[i];
    RoundDecision decision = DecideAfter(record, rule, samples_max, before, {});
    const bool same = decision.samples == record.samples_next;
    record.Take(std::move(decision));
    if (!same) {
      rounds->resize(i + 1);
      break;
    }
    before = record.cells;
  }
  return !rounds->back().samples_next.empty();
}

}  // namespace sheaf::coordinator
