// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmitterSilhouettes: predicts the part of a target's upper bound (RareHits, error_planes.h) that
// is due to the silhouettes of visible emitters. Silhouettes are curves, and a pilot's sparse
// blocks contain almost none of their pixels. The pilot's small image crosses them: its layer
// `emission` (light_path_kind.h) holds the emission that the camera sees directly. If rows and
// columns at a distance s change C times between emitter and background, the silhouettes have a
// length of pi / 4 s C (Cauchy and Crofton). The pixel filter determines how many pixels along a
// silhouette meet the emitter in exactly one replicate:
//
//     small image > crossings > stretches of silhouette
//     zoomed pilots of emitters that the small image may miss (zoomed_pilots.h) > pixels, fractions
//     stretches, pixels, samples of their cells > pixels with one hit and their errors > RareHits
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

// Pixels along a straight silhouette, averaged over its directions: those whose filter lies beyond
// the silhouette by the fraction `emitter`. width_px: their number per pixel of length.
struct SilhouetteFraction {
  double width_px = 0;
  double emitter = 0;
};
std::vector<SilhouetteFraction> FractionsBeyondSilhouettes(const FilterDescription& filter);

class EmitterSilhouettes {
 public:
  EmitterSilhouettes() = default;  // No silhouettes.
  // small: the frame made `shrink` times smaller, with one sample per pixel and the layers of light
  // paths. mean: the mean of R, G and B over the frame. window: that of the frame. cell_of: returns
  // the cell of a pixel of the frame, also for pixels slightly outside it.
  EmitterSilhouettes(const FrameImage& small, int32_t shrink,
                     std::span<const ZoomedPilot> zoomed_pilots, double mean,
                     const FilterDescription& filter, const PixelRect& window,
                     const std::function<size_t(int32_t x, int32_t y)>& cell_of);

  // Moves all silhouettes to the first cell, for a frame that has no others.
  void JoinCells();
  bool empty() const { return stretches_.empty() && pixels_.empty(); }
  // Total length of the silhouettes in the small image, in pixels of the frame.
  double LengthPx() const;
  // Adds the errors of silhouettes to those of cells with the given samples per pixel: their
  // variances, and the fraction of their estimated errors that a cell does not share with its tile
  // (cell_errors.h). deviations: the distance of the assumed length from its estimate, in its
  // standard deviations; positive means longer. random: draws the number of pixels with one hit;
  // null: uses the expected number. Requires: samples that are multiples of kReplicateCount.
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
  // Adds the errors of `pixels` pixels in which one of `samples` samples hits the emitter.
  void AddHits(const Place& place, uint64_t samples, double pixels, RareHits* hits,
               std::vector<ErrorSums>* cells) const;
  // The pixels per pixel of length in which exactly one replicate meets the emitter.
  double OneHitPixels(uint64_t samples) const;

  std::vector<Place> stretches_;
  double stretch_px_ = 0;      // Length of each stretch.
  std::vector<Pixel> pixels_;  // From zoomed pilots.
  std::vector<SilhouetteFraction> fractions_;
  double floor_ = 0;  // Added in the denominator of relative errors.
  double log_length_deviation_ = 0;
};

}  // namespace sheaf::coordinator
