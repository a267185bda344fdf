// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Fits an ErrorModel to a pilot. A pilot renders a few pixels of a frame (PixelLattice) with the
// samples of a first round, and some of them with more samples, which shows how fast errors fall.
// It also renders the whole frame at a small size. The small image gives the mean, which bounds the
// relative errors of dark pixels, and the silhouettes of emitters, which blocks miss:
//
//     images of lattices > errors of blocks > errors of cells, rate b > ErrorModel
//     small image > mean, EmitterSilhouettes                                     >
//     zoomed pilots of small emitters > EmitterSilhouettes                       >
//     light image (pilot_light.h) > LightModel                                   >
//
// The lattices of a frame with light paths show the camera's paths alone (HasLightPasses).
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/frame_image.h"
#include "common/film/pixel_lattice.h"
#include "common/scene/scene_description.h"
#include "coordinator/core/job/cell_grid.h"
#include "coordinator/forecast/cost_forecast.h"
#include "coordinator/forecast/zoomed_pilots.h"

namespace sheaf::coordinator {

// Samples per pixel in most of a pilot's blocks, and the maximum; powers of two. Errors at 8
// samples, one in each of 8 replicates, are twice those at the 16 samples of a first round, but
// twice as many pixels give a better estimate. Errors at 4 samples are overestimated by 1.1 times
// in two of seven scenes, those at 2 samples by up to 2 times: the true values of pixels are then
// too uncertain.
inline constexpr uint64_t kPilotSamples = 8;
inline constexpr uint64_t kPilotSamplesMax = 4 * uint64_t{kReplicateCount};
// Light passes of a light image, each in a replicate of its own, and as many samples per pixel.
inline constexpr uint64_t kPilotPasses = kPilotSamples;

// One image of a pilot.
struct PilotLevel {
  PixelLattice lattice;
  uint64_t samples = kPilotSamples;  // Per rendered pixel.
  int32_t shrink = 1;  // Above 1: the whole frame, this many times smaller, without a lattice.
  bool is_light_image = false;  // Otherwise an image without a lattice is the small image.
  // The level's samples, without light paths, divided by the pixels of the frame.
  double SamplesPerPixel() const {
    return lattice.SamplesPerPixel(samples) / (1.0 * shrink * shrink);
  }
};
struct PilotImage {
  PilotLevel level;
  FrameImage image;
  std::vector<double> cpu_seconds_of_tiles;  // Only for images of lattices.
  double light_cpu_seconds = 0;              // Light passes alone; only in light images.
  double training_cpu_seconds = 0;           // The training of a guided image.
};
// The costs of a pilot beside camera samples.
struct PilotTechniques {
  // Light paths of a pass over the pixels of the frame's window; 0: there are no light passes.
  double light_paths_per_pixel = 0;
  bool is_guided = false;  // Each image of a lattice has a training.
};

// Plans the next levels of a pilot, at a cost of at most `samples_per_pixel` samples per pixel of
// the frame. before: the levels that are rendered already; if there are none, the new ones include
// the small image. Large frames get relatively fewer blocks, as they do not need as many pixels. A
// pair (the same blocks with more samples) is included if it tells more about the rate than the
// prior over all scenes does. Returns an empty list if further levels would not improve the
// estimate. frame_seed: that of the frame's settings, for PixelLattice. With light paths, as many
// passes as samples_per_pixel are allowed in addition, for the light image and the small image.
// Guided frames get one image of a lattice at a time, as each costs a training.
std::vector<PilotLevel> PilotLevels(double samples_per_pixel, int64_t frame_pixel_count,
                                    uint64_t frame_seed, std::span<const PilotLevel> before,
                                    const PilotTechniques& techniques = {});

// Reads the CPU time of each of the frame's tiles from a pilot's metadata. Errors: kDataLoss if the
// number of tiles differs.
absl::StatusOr<std::vector<double>> TileCpuSecondsOf(
    const std::map<std::string, std::string>& metadata, size_t tile_count);

// Reads another CPU time of a pilot's metadata: "lightCpuSeconds" or "trainingCpuSeconds". Errors:
// kDataLoss if it is missing.
absl::StatusOr<double> CpuSecondsOf(const std::map<std::string, std::string>& metadata,
                                    const std::string& key);

// Fits the model. filter: that of the scene. zoomed_pilots: those of emitters that the small image
// may miss. Requires: images of the same frame, at least one of them of a lattice with the fewest
// samples; the CPU time of all tiles in images of lattices; pairs with equal lattices; the layers
// of light paths (--light-paths) in the small image, the light layer in light images.
ErrorModel FitErrorModel(const CellGrid& grid, std::span<const PilotImage> pilot,
                         std::span<const ZoomedPilot> zoomed_pilots,
                         const FilterDescription& filter);

}  // namespace sheaf::coordinator
