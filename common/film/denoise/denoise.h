// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Denoise: an image with less noise, and how far it is from the converged one, from the image and
// the two halves of its replicates (replicate_halves.h).
//
// Let A and B be the means of the halves, and X = a A + b B the image. The weights of a pixel's
// neighbors are computed twice: from A and applied to B, which gives D1, and from B and applied to
// A, which gives D2. Given A, D1 is a linear function of B with fixed weights, so that the
// neighbors' noise cannot choose its own weight, and the mean squared error of
//
//     D = X + l (a (D2 - A) + b (D1 - B))
//
// has an unbiased estimate for any fixed l (Stein 1981, for linear functions without the assumption
// of normal noise). With e1 = D1 - B, e2 = D2 - A, e = b e1 + a e2, the variances s_a^2, s_b^2 of A
// and B, and the weights w1, w2 that D1 and D2 give to the pixel itself, it is
//
//     C + 2 l G + l^2 e^2,  C = a^2 s_a^2 + b^2 s_b^2,
//     G = a b (A - B) (e1 - e2) - a s_a^2 (1 - w2) - b s_b^2 (1 - w1).
//
// There are two filters, one guided by albedo, normal, alpha and depth of the half that gives the
// weights, and one by light alone (block_filter.h). Each has such e and G, and their shares l are
// chosen for each pixel to minimize the estimate, summed over the other pixels around it: where the
// filters would do harm, the image is kept. The estimate is unbiased, but its noise is that of the
// image; expected_error.h makes less noise of it.
//
// Sources: Sakai et al. 2024, "A Statistical Approach to Monte Carlo Denoising"; Stein 1981,
// "Estimation of the Mean of a Multivariate Normal Distribution"; Rousselle et al. 2012, "Adaptive
// Rendering with Non-Local Means Filtering", for weights from the other half; Li et al. 2012,
// "SURE-based Optimization for Adaptive Sampling and Reconstruction", for the choice of filters.
#pragma once

#include <array>
#include <vector>

#include "common/film/denoise/replicate_halves.h"
#include "common/film/frame_image.h"

namespace sheaf {

struct DenoisedLight {
  std::array<std::vector<float>, 3> color;  // R, G, B.
  // The root of the expected squared error, noise and bias together, averaged over the pixels
  // around each one.
  std::array<std::vector<float>, 3> error;
  double mse = 0;  // The expected mean over pixels and R, G, B of the squared error.
};

// The most threads that are of use.
inline constexpr int kDenoiseThreadsMax = 64;

// The result is the same for any number of threads. A pixel whose halves do not both have 2
// replicates with samples keeps its color and standard error, and is no neighbor of others. Takes
// about 12 s of one processor and 0.4 GB for a million pixels.
// Requires: the image is from MakeFrameImage, and `halves` has all its tiles; threads is from 1 to
// kDenoiseThreadsMax.
DenoisedLight Denoise(const FrameImage& image, const ReplicateHalves& halves, int threads);

// Writes the layers of an image with the denoised output.
void SetDenoised(DenoisedLight light, FrameImage* image);

}  // namespace sheaf
