// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FLIP: how much two pictures differ to somebody who sees one after the other on a screen, from 0
// (nothing) to 1 (as far as colors can).
//
//     linear RGB > opponent colors > filters of contrast sensitivity > L*a*b* > color difference
//                         luminance > detectors of edges and points > feature difference
//     difference = color^(1 - feature)
//
// Sources: Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astrom and Fairchild 2020, "FLIP: A
// Difference Evaluator for Alternating Images" (section numbers in flip.cc are its), of which this
// is LDR-FLIP; Andersson, Nilsson, Shirley and Akenine-Moeller 2021, "Visualizing Errors in
// Rendered High Dynamic Range Images", for HDR-FLIP.
//
// The bits belong to this source, as elementary.h says: no C library, no sum in an order that
// threads choose.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace sheaf {

// A screen 0.7 m wide with 3840 pixels, seen from 0.7 m: the paper's, about 67.
inline constexpr double kFlipPixelsPerDegree = 3840 * 3.14159265358979324 / 180;

// Linear sRGB, row-major; the planes must outlive it. What is no number counts as 0.
struct FlipPicture {
  int32_t width_px = 0, height_px = 0;
  std::array<const float*, 3> rgb{};
};

// LDR-FLIP of each pixel, row-major, of the pictures cut to [0, 1], as a screen shows them without
// any other curve. Requires: equal sizes, not empty. Runs on all processors, a band of rows at a
// time; takes some 0.2 microseconds of one for each pixel and little memory beside the result.
std::vector<float> FlipMap(const FlipPicture& reference, const FlipPicture& image,
                           double pixels_per_degree = kFlipPixelsPerDegree);

// The mean over the pixels of FlipMap: what is commonly reported.
double MeanFlip(const FlipPicture& reference, const FlipPicture& image,
                double pixels_per_degree = kFlipPixelsPerDegree);

// HDR-FLIP: the mean over the pixels of the largest LDR-FLIP among exposures, from that at which
// the reference's brightest pixel is just seen to that of its median, a stop or less apart, through
// the ACES-like curve of the paper. It takes one FlipMap an exposure.
double MeanHdrFlip(const FlipPicture& reference, const FlipPicture& image,
                   double pixels_per_degree = kFlipPixelsPerDegree);

}  // namespace sheaf
