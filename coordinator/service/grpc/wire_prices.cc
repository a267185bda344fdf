// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of the wire for the costs of refinements and effects.
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/base/printable.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

v1::Estimate ToWire(const Estimate& estimate) {
  v1::Estimate wire;
  wire.set_value(estimate.value);
  wire.set_low(estimate.low);
  wire.set_high(estimate.high);
  return wire;
}

}  // namespace

absl::StatusOr<EffectCost> FromWire(const v1::EffectCost& wire) {
  if (wire.name().empty()) return absl::InvalidArgumentError("effect_costs.name: is empty");
  for (const std::string& text : {wire.name(), wire.problem(), wire.ablation()}) {
    if (text.size() <= kEffectTextBytesMax) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("effect_costs: a text is longer than ", kEffectTextBytesMax, " bytes"));
  }
  for (const double number :
       {wire.time_fraction(), wire.time_fraction_error(), wire.mean_change(),
        wire.mean_change_error(), wire.relative_mse(), wire.variance_ratio()}) {
    if (!std::isfinite(number))
      return absl::InvalidArgumentError("effect_costs: a number is not finite");
  }
  return EffectCost{
      Printable(wire.name()),   Printable(wire.problem()),  Printable(wire.ablation()),
      wire.time_fraction(),     wire.time_fraction_error(), wire.mean_change(),
      wire.mean_change_error(), wire.relative_mse(),        wire.variance_ratio()};
}

v1::EffectCost ToWire(const EffectCost& effect) {
  v1::EffectCost wire;
  wire.set_name(effect.name);
  wire.set_problem(effect.problem);
  wire.set_ablation(effect.ablation);
  wire.set_time_fraction(effect.time_fraction);
  wire.set_time_fraction_error(effect.time_fraction_error);
  wire.set_mean_change(effect.mean_change);
  wire.set_mean_change_error(effect.mean_change_error);
  wire.set_relative_mse(effect.relative_mse);
  wire.set_variance_ratio(effect.variance_ratio);
  return wire;
}

v1::PriceRefinementResponse ToWire(const RefinementPrices& priced) {
  v1::PriceRefinementResponse wire;
  for (const RefinementPrice& price : priced.prices) {
    v1::RefinementPrice& added = *wire.add_prices();
    added.set_target_error(price.target_error);
    added.set_reached(price.reached);
    *added.mutable_relative_mse() = ToWire(price.relative_mse);
    *added.mutable_samples_per_pixel() = ToWire(price.samples_per_pixel);
    *added.mutable_cpu_seconds() = ToWire(price.cpu_seconds);
    *added.mutable_wall_seconds() = ToWire(price.wall_seconds);
  }
  wire.set_thread_count(priced.thread_count);
  wire.set_jobs_before_count(priced.jobs_before_count);
  return wire;
}

}  // namespace sheaf::coordinator
