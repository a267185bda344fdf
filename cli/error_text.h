// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The one scale of errors that users see: the typical error of a pixel relative to its brightness,
// which is the root of relMSE (docs/accuracy.md). The web page uses the same words and digits
// (dashboard/src/format.ts). Options, JSON and metadata hold relMSE.
#pragma once

#include <string>

namespace sheaf::cli {

// "±14 %" for a relMSE of 0.02: two decimals below 1 %, one below 10 %, none above. "±0 %" for 0
// and below.
std::string FormatPixelError(double relative_mse);
// "±14 % (relMSE 0.02)".
std::string FormatBothErrors(double relative_mse);

// How noisy an image with this error looks, as a rule of thumb: "strong noise". Viewers see
// differences of brightness from about 1 to 2 % on (Weber's law).
const char* NoiseWords(double relative_mse);

}  // namespace sheaf::cli
