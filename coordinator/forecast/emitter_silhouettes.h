// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmitterSilhouettes: the part of the bound of a target (RareHits, error_planes.h) that the
// silhouettes of emitters in view will add. Silhouettes are lines, and a pilot's sparse blocks meet
// next to none of their pixels. The pilot's small image crosses them: its layer `emission`
// (light_path_kind.h) holds the emission that the camera sees directly, and rows and columns a
// distance s apart that change between emitter and none C times have crossed silhouettes of a
// length of pi / 4 s C (Cauchy and Crofton). The number of pixels along a silhouette that meet the
// emitter in one replicate alone follows from the pixel filter:
//
//     small image > crossings > stretches of silhouette
//     zoomed pilots of emitters that it may miss (zoomed_pilots.h) > pixels, fraction met
//     both, samples of their cells > pixels with one hit, its part of their error > RareHits
//
// Source: Santaló 1976, Integral Geometry and Geometric Probability, chapter I.3.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <span>
#include <vector>

#include "common/film/error/error_estimate.h"
#include "common/film/error/error_planes.h"
#include "common/film/frame_image.h"
#include "common/scene/scene_description.h"
#include "coordinator/forecast/emitter_colors.h"
#include "coordinator/forecast/zoomed_pilots.h"

namespace sheaf::coordinator {

// Along a straight silhouette of any direction: the number of pixels, per pixel of its length,
// whose filter has this fraction beyond it.
struct SilhouetteFraction {
  double width_px = 0;
  double emitter = 0;
};
std::vector<SilhouetteFraction> FractionsBeyondSilhouettes(const FilterDescription& filter);

class EmitterSilhouettes {
 public:
  EmitterSilhouettes() = default;  // There are none.
  // small: of one sample a pixel, with the layers of light paths; of the frame made `shrink` times
  // smaller. mean: the frame's, of R, G and B. window: the frame's. cell_of: of a pixel of the
  // frame, or a little outside.
  EmitterSilhouettes(const FrameImage& small, int32_t shrink,
                     std::span<const ZoomedPilot> zoomed_pilots, double mean,
                     const FilterDescription& filter, const PixelRect& window,
                     const std::function<size_t(int32_t x, int32_t y)>& cell_of);

  bool empty() const { return stretches_.empty() && pixels_.empty(); }
  double LengthPx() const;  // All silhouettes in the small image together.
  // To the errors of cells that have so many samples: their variances, and of what those pixels are
  // seen to err by as much as a cell keeps to itself (cell_errors.h). deviations: how many of its
  // standard deviations the length lies above what is known. random: where given, pixels are met by
  // chance, otherwise as many as are expected. Requires: multiples of kReplicateCount.
  void AddErrors(std::span<const uint64_t> samples, double deviations, std::mt19937_64* random,
                 std::vector<ErrorSums>* cells) const;

 private:
  struct Place {
    size_t cell = 0;
    EmitterColors::Color emitter, beside;
  };
  struct Pixel {
    Place place;
    double fraction = 0;  // The fraction of its filter that meets the emitter.
  };
  void AddStretches(const EmitterColors& image, int32_t shrink,
                    std::span<const ZoomedPilot> zoomed_pilots,
                    const std::function<size_t(int32_t x, int32_t y)>& cell_of);
  // Adds so many pixels that are like one with one hit among so many samples.
  void AddHits(const Place& place, uint64_t samples, double pixels, RareHits* hits,
               std::vector<ErrorSums>* cells) const;
  // Pixels for each pixel of length in whose samples one replicate alone meets the emitter.
  double OneHitPixels(uint64_t samples) const;

  std::vector<Place> stretches_;
  double stretch_px_ = 0;      // The length of each.
  std::vector<Pixel> pixels_;  // Those of zoomed pilots.
  std::vector<SilhouetteFraction> fractions_;
  double floor_ = 0;  // In the denominator of relative errors.
  double log_length_deviation_ = 0;
};

}  // namespace sheaf::coordinator
