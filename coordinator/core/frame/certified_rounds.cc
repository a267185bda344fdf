// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/certified_rounds.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"
#include "common/film/error/certificate.h"

namespace sheaf::coordinator {
namespace {

// The estimated bound at which the frame ends although its certified one is above the target.
double EstimateToEnd(double target, double certified, const RoundDecision& decision) {
  const bool is_out_of_reach = certified - decision.relative_mse >= target;
  return is_out_of_reach ? target : kCertificateOutOfReach * target;
}

// Whether the frame is expected to end at `samples` samples per pixel. The certified bound exceeds
// the estimate by an amount that hardly falls with more samples.
bool IsExpectedToEnd(double samples, double now, double rate, double target, double certified,
                     const RoundDecision& decision) {
  const double factor = std::pow(now / samples, rate);
  if (decision.relative_mse_upper * factor <= EstimateToEnd(target, certified, decision))
    return true;
  return certified > 0 &&
         decision.relative_mse * factor + (certified - decision.relative_mse) <= target;
}

}  // namespace

RoundDecision DecideCertifiedRound(const StopRule& rule, uint64_t samples_max, int round,
                                   double certified_upper, std::span<const CellRound> cells,
                                   std::span<const CellRound> before,
                                   const RoundAllowance& allowance) {
  SHEAF_CHECK(rule.certified && rule.target_error > 0 && !cells.empty());
  RoundDecision decision = ErrorsOfRound(round, cells);
  uint64_t now = 0;
  for (const CellRound& cell : cells) now = std::max(now, cell.samples);
  if ((certified_upper > 0 && certified_upper <= rule.target_error) ||
      decision.relative_mse_upper <= EstimateToEnd(rule.target_error, certified_upper, decision)) {
    decision.reason = StopReason::kTargetError;
    return decision;
  }
  if (now >= samples_max) return decision;
  const auto pixels = static_cast<double>(SumOf(cells).pixel_count);
  const double allowed = std::min(allowance.time, allowance.cpu);
  const double rate = MeasureRate(cells, before);
  uint64_t next = 0;
  while (next < kRoundGrowthMax * now) {
    const uint64_t more = std::min(samples_max, NextCertifiedStop(std::max(now, next)));
    if (pixels * static_cast<double>(more) > allowed) break;
    const bool is_last = more == next;
    next = more;
    if (is_last || IsExpectedToEnd(static_cast<double>(more), static_cast<double>(now), rate,
                                   rule.target_error, certified_upper, decision)) {
      break;
    }
  }
  if (next == 0) {
    decision.reason = allowance.time < allowance.cpu ? StopReason::kTime : StopReason::kCpu;
    return decision;
  }
  decision.samples.assign(cells.size(), next);
  const double factor = std::pow(static_cast<double>(now) / static_cast<double>(next), rate);
  decision.predicted_relative_mse = decision.relative_mse * factor;
  decision.sample_count_expected = static_cast<uint64_t>(pixels * static_cast<double>(next));
  return decision;
}

}  // namespace sheaf::coordinator
