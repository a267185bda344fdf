// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The difference of two images for display.
#pragma once

#include "absl/status/statusor.h"
#include "common/film/frame_image.h"
#include "coordinator/service/http/image/image_layer.h"

namespace sheaf::coordinator {

enum class DifferenceKind {
  // The root mean square over R, G and B of image - other, in the units of the image.
  kAbsolute,
  // The same with each difference over (|other| + 0.1 m), with m the mean of the other image: the
  // denominator of
  // relative errors (ImageLayer::kError) keeps dark pixels from dominating.
  kRelative,
};

// In false color on a logarithmic scale, shrunk as MakeDisplayImage does; equal pixels have the
// lowest color, and the range {0, 0} means that all are equal. Pixels that are not finite in either
// image are gray. range: none: that of the differences. Requires: R, G, B in both. Errors:
// kFailedPrecondition if the sizes differ.
absl::StatusOr<DisplayImage> MakeDifference(const FrameImage& image, const FrameImage& other,
                                            DifferenceKind kind,
                                            const ChosenRange& range = std::nullopt);

}  // namespace sheaf::coordinator
