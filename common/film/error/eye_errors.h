// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EyeErrors: the errors of a stereo image, of each eye and of their difference. A target holds for
// the worse eye.
//
// The error of the difference of a pixel is the sum of both eyes' errors there (error_estimate.h)
// times the variance of their difference over the sum of their variances. So it is in the units of
// the eyes' errors: their sum where the eyes are independent, less where they share paths, and 0
// where both have the same noise.
#pragma once

#include "common/film/error/error_estimate.h"
#include "common/film/frame_image.h"

namespace sheaf {

// The metadata of images that have their relative_mse.
inline constexpr char kLeftEyeErrorKey[] = "leftEyeRelativeMse";
inline constexpr char kRightEyeErrorKey[] = "rightEyeRelativeMse";
inline constexpr char kEyeDifferenceErrorKey[] = "eyeDifferenceRelativeMse";

struct EyeErrors {
  ErrorSums left, right, difference;

  // The errors of the worse eye, as if both eyes had them: the mean and its deviation are those of
  // that eye, the number of pixels is that of the image.
  ErrorSums OfWorse() const;
};

// Requires: HasEyeDifference(image).
EyeErrors EstimateEyeErrors(const FrameImage& image);

}  // namespace sheaf
