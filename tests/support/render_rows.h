// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderRows: renders a whole frame with one compiled variant, independent of the plan's choice.
#pragma once

#include "common/film/film_tile.h"
#include "worker/render/integrator/variants.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {

inline FilmTile RenderRows(const CompiledScene& scene, RenderRowFunction row) {
  const FrameSettings& settings = SettingsOf(scene);
  FilmTile tile(settings.window, {0, settings.samples});
  PixelAccumulator accumulator(&tile);
  RayCounts counts;
  for (int32_t y = settings.window.y0; y < settings.window.y1; ++y) {
    row(scene, settings.window.x0, settings.window.x1, y, {0, settings.samples}, &accumulator,
        &counts);
  }
  return tile;
}

}  // namespace sheaf::render
