// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The depth that compositing programs expect, in a copy of a delivered image, which has distances
// along rays (docs/outputs.md).
#pragma once

#include "absl/status/status.h"
#include "common/film/frame_image.h"

namespace sheaf::cli {

// The depth if nothing was hit: farther than all else, as Blender writes it. Infinity would become
// NaN in filters.
inline constexpr float kBackgroundDepth = 1e10f;
// The metadata of such a copy, which cannot be resumed: kDepthKey (common/film/exr) with this.
inline constexpr char kPlaneDepth[] = "plane";

// Replaces each distance in depth.Z by that from the plane of the camera, in the direction of the
// pixel's center, and the 0 of the background by kBackgroundDepth. Errors: kFailedPrecondition,
// with the image unchanged, if the camera has no such plane.
absl::Status MakePlaneDepth(FrameImage* image);

}  // namespace sheaf::cli
