// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_prices.h"

#include <algorithm>
#include <cmath>

#include "coordinator/core/job/work_left.h"

namespace sheaf::cli {
namespace {

// The point's error for another number of samples, along a rate.
Estimate Move(const StudyPoint& point, double samples, double rate) {
  const double factor = std::pow(samples / point.samples, -rate);
  return {factor * point.relative_mse.value, factor * point.relative_mse.error};
}

}  // namespace

std::optional<Estimate> ErrorAt(const StudyCurve& curve, double samples) {
  if (curve.points.empty() || !(samples > 0)) return std::nullopt;
  const double rate = curve.rate && curve.rate->value > 0 ? curve.rate->value : 1;
  const auto right =
      std::find_if(curve.points.begin(), curve.points.end(),
                   [samples](const StudyPoint& point) { return point.samples >= samples; });
  if (right == curve.points.end()) return Move(curve.points.back(), samples, rate);
  if (right == curve.points.begin()) return Move(*right, samples, rate);
  const StudyPoint& a = *(right - 1);
  const StudyPoint& b = *right;
  const double between =
      std::log(a.relative_mse.value / b.relative_mse.value) / std::log(b.samples / a.samples);
  return Move(b, samples, between);
}

double WallSecondsOn(int threads, double cpu_seconds) {
  return cpu_seconds / (coordinator::kUsualThreadUse * threads);
}

double SamplesIn(double seconds, int threads, double cpu_seconds_per_sample,
                 double training_cpu_seconds) {
  const double cpu_seconds = seconds * coordinator::kUsualThreadUse * threads;
  return std::max(0.0, cpu_seconds - training_cpu_seconds) / cpu_seconds_per_sample;
}

}  // namespace sheaf::cli
