// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/error_text.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"

namespace sheaf::cli {

std::string FormatPixelError(double relative_mse) {
  if (!(relative_mse > 0)) return "±0 %";
  const double percent = 100 * std::sqrt(relative_mse);
  const int digits = percent < 1 ? 2 : percent < 10 ? 1 : 0;
  return absl::StrFormat("±%.*f %%", digits, percent);
}

std::string FormatBothErrors(double relative_mse) {
  return absl::StrFormat("%s (relMSE %.2g)", FormatPixelError(relative_mse), relative_mse);
}

const char* NoiseWords(double relative_mse) {
  const double error = std::sqrt(std::max(0.0, relative_mse));
  if (error >= 0.25) return "a rough preview";
  if (error >= 0.1) return "strong noise";
  if (error >= 0.04) return "visible noise";
  return error >= 0.015 ? "fine grain" : "hardly any noise";
}

}  // namespace sheaf::cli
