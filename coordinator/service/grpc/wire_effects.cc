// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The costs of effects, on the wire.
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/base/printable.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {

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

}  // namespace sheaf::coordinator
