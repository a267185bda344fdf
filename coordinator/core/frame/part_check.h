// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The limits that a frame's settings set to the sums of its parts, beyond those of every part,
// which DecodePart checks (counts, finite values, no negative light). A part that no renderer can
// have made is refused. Plausible false parts pass; a second render finds them.
#pragma once

#include <string>

#include "common/film/film_tile.h"
#include "common/film/task_kind.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::coordinator {

// Why the part cannot be one of a frame with these settings; empty where it can. Looks once at each
// value. Checked of camera samples, where the filter has no negative weights: coverage (alpha)
// within [0, 1], and no response above max_component_value (of frames without a sensor). Checked
// everywhere: the sums of the replicates, from which the errors are estimated, add up to the sums
// of the pixel, within the rounding of float32. Requires: the part was decoded by DecodePart.
std::string WhyNotOfSettings(const FilmTile& part, const FrameSettings& settings,
                             TaskKind kind = TaskKind::kCamera);

}  // namespace sheaf::coordinator
