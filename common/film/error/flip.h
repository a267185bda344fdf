// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FLIP: the difference that a viewer perceives when alternating between two images on a screen,
// from 0 (none) to 1 (the largest difference of colors).
//
//     linear RGB > opponent colors > filters of contrast sensitivity > L*a*b* > color difference
//                         luminance > detectors of edges and points > feature difference
//     difference = color^(1 - feature)
//
// Sources: Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astrom and Fairchild 2020, "FLIP: A
// Difference Evaluator for Alternating Images" (flip.cc cites its section numbers), which defines
// LDR-FLIP; Andersson, Nilsson, Shirley and Akenine-Moeller 2021, "Visualizing Errors in Rendered
// High Dynamic Range Images", for HDR-FLIP.
//
// The bits depend only on this source, as in elementary.h: no functions of the C library, no sum
// whose order depends on threads.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace sheaf {

// The paper's viewing conditions: a screen 0.7 m wide with 3840 pixels, seen from 0.7 m; about 67.
inline constexpr double kFlipPixelsPerDegree = 3840 * 3.14159265358979324 / 180;

// Linear sRGB, row-major; the planes must outlive it. NaN counts as 0.
struct FlipImage {
  int32_t width_px = 0, height_px = 0;
  std::array<const float*, 3> rgb{};
};

// LDR-FLIP of each pixel, row-major, of the images clipped to [0, 1], as a screen shows them
// without a tone curve.
// Requires: equal sizes, not empty. Runs on all processors, a band of rows at a time; takes some
// 0.2 microseconds of one processor per pixel and little memory beside the result.
std::vector<float> FlipMap(const FlipImage& reference, const FlipImage& image,
                           double pixels_per_degree = kFlipPixelsPerDegree);

// The mean over the pixels of FlipMap: the value commonly reported.
double MeanFlip(const FlipImage& reference, const FlipImage& image,
                double pixels_per_degree = kFlipPixelsPerDegree);

// HDR-FLIP: the mean over the pixels of the largest LDR-FLIP over a range of exposures, through the
// ACES-like curve of the paper. The range runs from the exposure at which the reference's brightest
// pixel is just visible to that for its median, in steps of at most one stop. Costs one FlipMap per
// exposure.
double MeanHdrFlip(const FlipImage& reference, const FlipImage& image,
                   double pixels_per_degree = kFlipPixelsPerDegree);

}  // namespace sheaf
