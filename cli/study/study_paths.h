// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Measures which kinds of paths make a study's noise, and in which tiles error bars are unreliable.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "cli/study/study_scenes.h"
#include "common/film/tile_geometry.h"
#include "worker/render/path_noise.h"

namespace sheaf::cli {

struct StudyPath {
  LightPathKind kind;
  render::PathFractions fractions;
};

// A tile whose error estimate is unreliable (mean_interval.h), and the kind of path that causes it.
struct UnreliableTile {
  PixelRect rect;
  LightPathKind kind;
  double variance_fraction = 0;  // Fraction of the tile's variance due to this kind.
};

struct StudyPaths {
  std::vector<StudyPath> paths;    // Kinds with a contribution.
  size_t assessed_tile_count = 0;  // Those for which there was time.
  std::vector<UnreliableTile> unreliable_tiles;
};

// The samples of a pixel, and the light passes, for distinguishing kinds of paths.
inline constexpr uint64_t kPathSamples = 64;

// The scene's settings request the kinds of paths and no other output. mean: of the image. seconds:
// for the tiles, after light passes; those for which it does not suffice are left out, but not the
// first, and those measured are spread over the frame. Errors: as RenderTilePass and
// RenderLightPass.
absl::StatusOr<StudyPaths> MeasurePathNoise(const StudyScene& scene,
                                            const std::vector<PixelRect>& tiles, double mean,
                                            int threads, double seconds);

}  // namespace sheaf::cli
