// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SampleBound: the proven range of a frame's samples, which the certificate of its error requires
// (common/film/error/certificate.h).
#pragma once

#include <array>
#include <optional>
#include <string>

#include "common/scene/settings/render_settings.h"

namespace sheaf {

struct SampleBound {
  // Samples of R, G and B, in the linear sRGB of the film's sums, are between 0 and these values.
  // None if no such bound is proved, or if pixels are not independent.
  std::optional<std::array<double, 3>> most;
  // The proof, or why there is none: "X, Y and Z of a sample are at most 10 (maxcomponentvalue)".
  std::string reason;
};

// A film with a maximum clamps X, Y and Z of a sample to it. In rgb transport R, G and B are not
// negative, so none can exceed the maximum over its own largest share of X, Y or Z. Pixels are
// independent if each has its own samples of camera paths.
SampleBound SampleBoundOf(const FrameSettings& settings);

}  // namespace sheaf
