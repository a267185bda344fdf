// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ShrunkFrame: the settings of the whole frame made smaller, on which light passes are measured. A
// pass has one light path for each pixel of any frame, so a pixel of the smaller one meets as many
// splats: the noise of a pixel, relative to its value, and the cost of a path are nearly those of
// the frame (docs/adr/0069).
#pragma once

#include <cstdint>

#include "common/scene/settings/render_settings.h"

namespace sheaf::cli {

// The same view with each length divided by shrink and rounded; at least a pixel. shrink 1 gives
// the same settings. Requires: shrink > 0.
FrameSettings ShrunkFrame(FrameSettings settings, int32_t shrink);

}  // namespace sheaf::cli
