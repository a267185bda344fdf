// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// From a pilot to an ErrorModel. A pilot is a frame rendered at few of its pixels (PixelLattice):
// some once at the samples of a first round, and some of them twice, so that it can be told how
// their errors fall:
//
//     pictures of the pilot > errors of their pixels > errors of tiles, rate b > ErrorModel
#pragma once

#include <span>
#include <vector>

#include "common/film/frame_picture.h"
#include "common/film/pixel_lattice.h"
#include "coordinator/core/cost_forecast.h"

namespace sheaf::coordinator {

// Of a pixel of a pilot, at most; a power of two.
inline constexpr uint64_t kPilotSamplesMax = 4 * uint64_t{kReplicateCount};

// One picture of a pilot.
struct PilotLevel {
  PixelLattice lattice;
  uint64_t samples = kReplicateCount;  // Of each of its pixels.
  // What it costs, spread over all pixels of the frame.
  double SamplesPerPixel() const { return lattice.SamplesPerPixel(samples); }
};
struct PilotPicture {
  PilotLevel level;
  FramePicture picture;
  std::vector<double> cpu_seconds_of_tiles;
};

// The levels of a pilot that costs at most `samples_per_pixel` of all of a frame's pixels: one
// picture with the first round's samples, and a pair at fewer pixels. Coarser for large frames, of
// which so many pixels are not needed.
std::vector<PilotLevel> PilotLevels(double samples_per_pixel, int64_t frame_pixel_count);
// Just a pair, to go on with where that was not enough; empty where even that costs too much.
std::vector<PilotLevel> PilotPair(double samples_per_pixel, int64_t frame_pixel_count);

// thread_count: that took part. Requires: pictures of one frame, each with the CPU time of all of
// its tiles; levels with the least samples, and pairs of one lattice.
ErrorModel FitErrorModel(std::span<const PixelRect> tiles, std::span<const PilotPicture> pilot,
                         int thread_count);

}  // namespace sheaf::coordinator
