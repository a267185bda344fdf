// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/one_sequence.h"

#include <cmath>

#include "common/film/film_tile.h"

namespace sheaf::coordinator {
namespace {

// Limits of the factor by which errors of independent samples would have fallen from the earlier
// point to the last one. The minimum: less than a doubling of samples does not determine a rate.
// The maximum, which applies if there is a choice: the rates of short sequences differ from those
// of long ones.
constexpr double kDropMin = 1.8, kDropMax = 8.5;

double DropOfIndependent(const RoundRecord& before, const RoundRecord& last) {
  double foreseen = 0;
  for (size_t i = 0; i < last.cells.size(); ++i) {
    const auto samples = static_cast<double>(last.cells[i].samples);
    foreseen += ForeseeError(before.cells[i], samples, /*rate=*/1).sum;
  }
  return foreseen > 0 ? SumOf(before.cells).sum / foreseen : 0;
}

// Standard deviation of the logarithm of an image's error.
double LogDeviation(const ErrorSums& sum) { return sum.Deviation() / sum.RelativeMse(); }

double GainAt(double rate) { return std::pow(kReplicateCount, rate - 1); }

// The point that the last one is compared with; null if there is none.
const RoundRecord* PointBefore(std::span<const RoundRecord> points) {
  const RoundRecord* before = nullptr;
  for (const RoundRecord& point : points) {
    if (point.cells.size() != points.back().cells.size()) continue;
    const double drop = DropOfIndependent(point, points.back());
    if (drop >= kDropMin) before = &point;
    if (drop <= kDropMax) break;
  }
  return before;
}

}  // namespace

double OneSequenceGain(std::span<const RoundRecord> points) {
  const RoundRecord* before = PointBefore(points);
  if (before == nullptr) return 0;
  const RoundRecord& last = points.back();
  const ErrorSums first_sum = SumOf(before->cells), last_sum = SumOf(last.cells);
  if (last_sum.sum <= 0) return 0;
  const double rate = MeasureRate(last.cells, before->cells);
  const double deviation = std::hypot(LogDeviation(first_sum), LogDeviation(last_sum)) /
                           std::log(DropOfIndependent(*before, last));
  const bool is_significant = GainAt(rate - kPointDeviations * deviation) > kOneSequenceGainMin;
  return is_significant ? GainAt(rate) : 0;
}

}  // namespace sheaf::coordinator
