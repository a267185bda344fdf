// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Fits the LightModel of a frame with light paths to a pilot (pilot_model.h). A light pass covers
// the whole frame, and a single one costs more than a whole pilot may. But a pass has one light
// path for each pixel of any frame, so a pixel meets as many splats in a frame made smaller: their
// noise, relative to the pixel's value, and the cost of a path are nearly the same. The pilot's
// light image is the whole frame made smaller, at a few passes:
//
//     light image, light layer > light of every place   > errors of the blocks of lattices
//                              > errors of light passes > errors of cells
//                              > cost of a light path   > cost of a pass
//
// Where a caustic is narrower than a pixel of the light image, its noise is overestimated: the
// frame's pixels in it meet more splats than those beside it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "coordinator/forecast/pilot_model.h"

namespace sheaf::coordinator {

// The fraction of each pixel's variance that is due to light passes. Requires: an image with the
// light layer (light_image.h).
std::vector<double> LightFractions(const FrameImage& image);

// The pilot's largest light image; null if it has none.
const PilotImage* FindLightImage(std::span<const PilotImage> pilot);

// The light that light paths add to R, G and B of each of the frame's pixels, from the light layer:
// the mean over 3 x 3 pixels of the light image, as single ones are noisy. planes: three, of the
// values of a lattice's image, of the window's size; pixels without samples are not changed.
void AddLightOf(const PilotImage& light, const FrameImage& sparse,
                std::array<std::vector<float>, 3>* planes);

// mean: that of R, G and B over the frame. cell_of: the cell of a pixel of the frame, also for
// pixels slightly outside it. frame_paths: the paths of a pass of the frame. Requires: an image
// with the light layer.
LightModel FitLight(const CellGrid& grid, const PilotImage& light, double mean,
                    const std::function<size_t(int32_t x, int32_t y)>& cell_of, double frame_paths);

}  // namespace sheaf::coordinator
