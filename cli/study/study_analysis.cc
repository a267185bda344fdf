// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_analysis.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>
#include <utility>

namespace sheaf::cli {
namespace {

constexpr int kBootstrapCount = 200;
// Factor in error by which the base's curve may be extrapolated beyond its first and last point.
constexpr double kExtrapolationMax = 4;
// A point counts as different from 0 if it is this many standard errors above it.
constexpr double kReportedDeviations = 2;

using TileSums = std::vector<double>;
// Indices of the tiles that an estimate uses, with repetitions.
using Choice = std::vector<size_t>;

double MeanOver(const Choice& tiles, const TileSums& sums, const TileSums& counts) {
  double sum = 0, count = 0;
  for (const size_t tile : tiles) {
    sum += sums[tile];
    count += counts[tile];
  }
  return sum / count;
}

Choice AllOf(size_t count) {
  Choice all(count);
  std::iota(all.begin(), all.end(), size_t{0});
  return all;
}

Estimate EstimateMean(const TileSums& sums, const TileSums& counts) {
  Estimate estimate{MeanOver(AllOf(sums.size()), sums, counts), 0};
  const auto n = static_cast<double>(sums.size());
  if (sums.size() < 2) return estimate;
  double squares = 0, count = 0;
  for (size_t tile = 0; tile < sums.size(); ++tile) {
    const double rest = sums[tile] - estimate.value * counts[tile];
    squares += rest * rest;
    count += counts[tile];
  }
  estimate.error = std::sqrt(squares * n / (n - 1)) / count;
  return estimate;
}

// value(tiles): the estimate from these tiles; nullopt if they do not determine it.
std::optional<Estimate> Bootstrap(
    size_t tile_count, const std::function<std::optional<double>(const Choice&)>& value) {
  const std::optional<double> of_all = value(AllOf(tile_count));
  if (!of_all) return std::nullopt;
  std::mt19937_64 random(tile_count);
  double sum = 0, square_sum = 0, count = 0;
  Choice choice(tile_count);
  for (int i = 0; i < kBootstrapCount; ++i) {
    for (size_t& tile : choice) tile = random() % tile_count;
    const std::optional<double> v = value(choice);
    if (!v) continue;
    sum += *v;
    square_sum += *v * *v;
    ++count;
  }
  if (count < kBootstrapCount / 2) return std::nullopt;
  const double mean = sum / count;
  return Estimate{*of_all, std::sqrt(std::max(0.0, square_sum / count - mean * mean))};
}

struct LogPoint {
  double x = 0, y = 0;
};

// Slope of the least-squares line through the points; nullopt for fewer than two.
std::optional<double> SlopeOf(const std::vector<LogPoint>& points) {
  if (points.size() < 2) return std::nullopt;
  double x = 0, y = 0, xx = 0, xy = 0;
  const auto n = static_cast<double>(points.size());
  for (const LogPoint& p : points) {
    x += p.x / n;
    y += p.y / n;
  }
  for (const LogPoint& p : points) {
    xx += (p.x - x) * (p.x - x);
    xy += (p.x - x) * (p.y - y);
  }
  return xx > 0 ? std::optional(xy / xx) : std::nullopt;
}

bool TellsVariance(const StudySetting& setting) { return !setting.settings.one_sequence; }

std::optional<double> RateOf(const StudyMeasurement& measured, const TileSums& counts,
                             const Choice& tiles) {
  if (measured.setting.stops_tiles) return std::nullopt;
  const bool of_variance = TellsVariance(measured.setting);
  std::vector<LogPoint> points;
  for (const StudyCheckpoint& c : measured.checkpoints) {
    const double error = MeanOver(tiles, of_variance ? c.variance : c.error, counts);
    if (error > 0) points.push_back({std::log(c.samples), std::log(error)});
  }
  const std::optional<double> slope = SlopeOf(points);
  return slope ? std::optional(-*slope) : std::nullopt;
}

// CPU seconds in which the base reaches this error: interpolated between its points, and
// extrapolated beyond them by the line through the nearest two.
std::optional<double> BaseSeconds(const StudyMeasurement& base, const TileSums& counts,
                                  const Choice& tiles, double error) {
  std::vector<LogPoint> points;
  for (const StudyCheckpoint& c : base.checkpoints) {
    const double e = MeanOver(tiles, c.error, counts);
    if (e > 0) points.push_back({std::log(e), std::log(c.cpu_seconds)});
  }
  if (points.size() < 2 || !(error > 0)) return std::nullopt;
  const double x = std::log(error), reach = std::log(kExtrapolationMax);
  if (x > points.front().x + reach || x < points.back().x - reach) return std::nullopt;
  size_t right = 1;  // Errors fall with increasing index.
  while (right + 1 < points.size() && points[right].x > x) ++right;
  const LogPoint a = points[right - 1], b = points[right];
  if (a.x == b.x) return std::nullopt;
  return std::exp(a.y + (b.y - a.y) * (x - a.x) / (b.x - a.x));
}

std::optional<double> GainOf(const StudyMeasurement& base, const StudyMeasurement& measured,
                             const TileSums& counts, const Choice& tiles) {
  const StudyCheckpoint& last = measured.checkpoints.back();
  const std::optional<double> seconds =
      BaseSeconds(base, counts, tiles, MeanOver(tiles, last.error, counts));
  return seconds ? std::optional(*seconds / last.cpu_seconds) : std::nullopt;
}

StudyCurve CurveOf(const StudyMeasurement& base, const StudyMeasurement& measured,
                   const TileSums& counts) {
  StudyCurve curve;
  curve.setting = measured.setting;
  for (const StudyCheckpoint& c : measured.checkpoints) {
    const Estimate error = EstimateMean(c.error, counts);
    if (error.value > kReportedDeviations * error.error && error.value > 0) {
      curve.points.push_back({c.samples, c.cpu_seconds, error, false});
    }
  }
  if (measured.checkpoints.empty()) return curve;
  curve.rate = Bootstrap(counts.size(),
                         [&](const Choice& tiles) { return RateOf(measured, counts, tiles); });
  if (TellsVariance(measured.setting)) {
    const StudyCheckpoint& last = measured.checkpoints.back();
    TileSums bias(counts.size());
    for (size_t tile = 0; tile < counts.size(); ++tile) {
      bias[tile] = last.error[tile] - last.variance[tile];
    }
    curve.bias_floor = EstimateMean(bias, counts);
  }
  if (!measured.setting.is_base) {
    curve.gain = Bootstrap(
        counts.size(), [&](const Choice& tiles) { return GainOf(base, measured, counts, tiles); });
    if (curve.gain) {
      curve.gain->error =
          std::hypot(curve.gain->error, curve.gain->value * measured.time_deviation);
    }
  }
  return curve;
}

// Biased settings render other images, so they do not compete.
void MarkFront(std::vector<StudyCurve>* curves) {
  std::vector<StudyPoint*> points;
  for (StudyCurve& curve : *curves) {
    if (!curve.setting.is_unbiased) continue;
    for (StudyPoint& point : curve.points) points.push_back(&point);
  }
  std::sort(points.begin(), points.end(), [](const StudyPoint* a, const StudyPoint* b) {
    return std::pair(a->cpu_seconds, a->relative_mse.value) <
           std::pair(b->cpu_seconds, b->relative_mse.value);
  });
  double least = 0;
  for (StudyPoint* point : points) {
    point->on_pareto_front = least == 0 || point->relative_mse.value < least;
    if (point->on_pareto_front) least = point->relative_mse.value;
  }
}

}  // namespace

double RatioDeviation(const std::vector<double>& over, const std::vector<double>& under) {
  const auto n = static_cast<double>(over.size());
  double sum = 0, square_sum = 0;
  for (size_t i = 0; i < over.size(); ++i) {
    const double ratio = under[i] > 0 ? over[i] / under[i] : 0;
    sum += ratio;
    square_sum += ratio * ratio;
  }
  if (n < 2 || !(sum > 0)) return 0;
  return std::sqrt(std::max(0.0, square_sum - sum * sum / n) * n / (n - 1)) / sum;
}

std::vector<StudyCurve> AnalyzeStudy(const std::vector<StudyMeasurement>& measurements,
                                     const std::vector<double>& pixel_counts) {
  std::vector<StudyCurve> curves;
  curves.reserve(measurements.size());
  for (const StudyMeasurement& measured : measurements) {
    curves.push_back(CurveOf(measurements.front(), measured, pixel_counts));
  }
  MarkFront(&curves);
  return curves;
}

}  // namespace sheaf::cli
