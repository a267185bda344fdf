// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SplatSink: receives what light paths bring to the film.
#pragma once

#include <cstdint>

#include "common/film/light_path_kind.h"
#include "common/math/vec.h"

namespace sheaf::render {

class SplatSink {
 public:
  virtual ~SplatSink() = default;
  // Whether a pixel receives light from this raster position. May be true where none does.
  virtual bool Covers(Vec2d raster) const = 0;
  // radiance: linear sRGB; what the pixels about the raster position gain in one pass, before their
  // filter. kind, group: for the film's layers; group is an index in FilmOutputs::light_groups.
  virtual void Add(Vec2d raster, Rgb radiance, LightPathKind kind, uint32_t group) = 0;
};

}  // namespace sheaf::render
