// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// From a pilot to an ErrorModel. A pilot is a frame rendered at few of its pixels (PixelLattice) at
// the samples of a first round, some of them with more, so that it can be told how their errors
// fall; and the whole frame made small, for its mean, against which dark pixels' errors are held,
// and for the silhouettes of emitters, which blocks do not meet:
//
//     images of the pilot > errors of their blocks > errors of cells, rate b > ErrorModel
//     the small image > mean, EmitterSilhouettes                                       >
//     zoomed pilots of small emitters > EmitterSilhouettes                               >
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/frame_image.h"
#include "common/film/pixel_lattice.h"
#include "common/scene/scene_description.h"
#include "coordinator/core/cell_grid.h"
#include "coordinator/forecast/cost_forecast.h"
#include "coordinator/forecast/zoomed_pilots.h"

namespace sheaf::coordinator {

// Samples per pixel of a pilot: in most blocks, and at most; powers of two. Errors of 8 samples,
// one in each of 8 replicates, are twice those of the 16 of a first round, and twice as many pixels
// tell more. Errors of 4 samples are 1.1 times too high in two of seven scenes, those of 2 up to
// twice: too little is known then of the pixels' true values.
inline constexpr uint64_t kPilotSamples = 8;
inline constexpr uint64_t kPilotSamplesMax = 4 * uint64_t{kReplicateCount};

// One image of a pilot.
struct PilotLevel {
  PixelLattice lattice;
  uint64_t samples = kPilotSamples;  // Per pixel that is rendered.
  int32_t shrink = 1;  // More: all pixels of the frame made so many times smaller, and no lattice.
  // Its samples, spread over all pixels of the frame.
  double SamplesPerPixel() const {
    return lattice.SamplesPerPixel(samples) / (1.0 * shrink * shrink);
  }
};
struct PilotImage {
  PilotLevel level;
  FrameImage image;
  std::vector<double> cpu_seconds_of_tiles;  // Only where the image is of a lattice.
};

// The levels of a pilot that costs at most `samples_per_pixel` of all of a frame's pixels, where
// those of `before` are there. The first has the small image. Blocks are fewer in large frames,
// which do not need so many pixels; a pair, of the same blocks with more samples, is there where it
// tells more than what is known of all scenes. Empty where more would not tell more. frame_seed: of
// the frame's settings, as PixelLattice has it.
std::vector<PilotLevel> PilotLevels(double samples_per_pixel, int64_t frame_pixel_count,
                                    uint64_t frame_seed, std::span<const PilotLevel> before);

// The CPU time of each of the frame's tiles, from a pilot's metadata. Errors: kDataLoss where they
// have another number of tiles.
absl::StatusOr<std::vector<double>> TileCpuSecondsOf(
    const std::map<std::string, std::string>& metadata, size_t tile_count);

// filter: the scene's. zoomed_pilots: of emitters that the small image may miss. Requires: images
// of one frame, one of a lattice with the least samples among them; those of lattices with the CPU
// time of all tiles; pairs of one lattice; the small one with the layers of light paths.
ErrorModel FitErrorModel(const CellGrid& grid, std::span<const PilotImage> pilot,
                         std::span<const ZoomedPilot> zoomed_pilots,
                         const FilterDescription& filter);

}  // namespace sheaf::coordinator
