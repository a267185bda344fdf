// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The command line that renders one tile of a frame again, alone and on one machine: for looking
// into what failed.
#pragma once

#include <cstdint>
#include <string>

#include "common/film/tile_geometry.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::coordinator {

// "sheaf render room.pbrt --crop 0,0,32,32 --samples 16 ...": samples [0, sample_count) of the
// tile, with all that decides its pixels. `scene`: a path as a shell reads it; it is quoted where
// it has to be.
std::string RenderCommand(const std::string& scene, const FrameSettings& settings,
                          const PixelRect& tile, uint64_t sample_count);

}  // namespace sheaf::coordinator
