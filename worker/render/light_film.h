// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightFilm: the film of light paths. A splat adds to every pixel whose filter covers its film
// point, by the filter over its integral, as a sample of the camera there would count for the
// pixel.
//
// A pixel's filter may reach beyond the edge of the frame. The film of a spherical camera continues
// there on the other side of its map (Camera::MakeRay), so a splat counts for the pixels near each
// of its images in the continued plane. The plane consists of copies of the map, numbered (i, j)
// from the frame's (0, 0). Copies of an equal-area map with odd i + j are turned by half a turn, as
// each edge is folded at its middle; copies of an equirectangular map with odd j are mirrored
// vertically and moved by half its width, as paths across a pole come back on the other side.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "common/scene/scene_description.h"
#include "worker/render/integrator/splat_sink.h"
#include "worker/render/sampling/filter.h"

namespace sheaf::render {

// The continuation of the film beyond the frame.
enum class FilmEdges : uint8_t { kNone, kEquirectangular, kEqualArea };
FilmEdges FilmEdgesOf(const CameraDescription& camera);

struct LightFilm {
  PixelRect window;  // The pixels that are kept.
  int32_t width_px = 0, height_px = 0;
  FilmEdges edges = FilmEdges::kNone;
  const PixelFilter* filter = nullptr;
  FilmOutputs outputs;
};

// The points of the continued film that show the film point `raster` and whose filters, of the
// given radius, may reach pixels of the frame; the first is the point itself.
std::vector<Vec2d> ImagesOf(const LightFilm& film, Vec2d raster, Vec2d radius_px);

// A splat that is not finite: the first ones are reported.
struct LostSplat {
  Vec2d raster;
  uint64_t pass = 0;
};

// Calls trace(pass, sink) for each pass of the block, in ascending order, and sums what it splats.
// lost: receives splats that are not finite, at most PixelAccumulator::kNonFiniteReportsMax.
// Memory: that of LightPassAccumulator, and for more than LightPassAccumulator::kPassesMax passes,
// that of TileTree. Errors: those of trace. Requires: IsAligned(block); window not empty.
using TracePass = std::function<absl::Status(uint64_t pass, SplatSink* splats)>;
absl::StatusOr<FilmTile> SumLightPasses(const LightFilm& film, SampleBlock block,
                                        const TracePass& trace, std::vector<LostSplat>* lost);

}  // namespace sheaf::render
