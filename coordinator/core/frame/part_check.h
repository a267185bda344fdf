// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The limits that a frame's settings set to the sums of its parts, beyond those of every part,
// which DecodePart checks (counts, finite values, no negative light). A part that no renderer can
// have made is refused. Plausible false parts pass; a second render detects them.
#pragma once

#include <string>

#include "common/film/film_tile.h"
#include "common/film/task_kind.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::coordinator {

// Returns why the part cannot belong to a frame with these settings; empty if it can. Reads each
// value once. Checks camera samples, if the filter has no negative weights: coverage (alpha) is
// within [0, 1], and no response exceeds max_component_value (in frames without a sensor). Checks
// all parts: the sums of the replicates, from which errors are estimated, add up to the sums of the
// pixel, within float32 rounding. Requires: the part was decoded by DecodePart.
std::string WhyNotOfSettings(const FilmTile& part, const FrameSettings& settings,
                             TaskKind kind = TaskKind::kCamera);

}  // namespace sheaf::coordinator
