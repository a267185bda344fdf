// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The command line that renders one tile of a frame again, on one machine, to investigate a
// failure.
#pragma once

#include <cstdint>
#include <string>

#include "common/film/tile_geometry.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::coordinator {

// Returns "sheaf render room.pbrt --crop 0,0,32,32 --samples 16 ...", which renders samples
// [0, sample_count) of the tile with all settings that affect its pixels. scene: the scene's path,
// unquoted; it is quoted in the result if a shell requires that.
std::string RenderCommand(const std::string& scene, const FrameSettings& settings,
                          const PixelRect& tile, uint64_t sample_count);

}  // namespace sheaf::coordinator
