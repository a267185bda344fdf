// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// pbrt-v4's lens files: four numbers per surface (radius of curvature, thickness, index of
// refraction of the medium behind, diameter of the aperture; millimeters), from the scene to the
// film. "#" begins a comment. A radius of 0 is flat; an index of 0 is that of air.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/lens_description.h"

namespace sheaf {

// Maximum number of surfaces of a lens. The longest zooms have about 60.
inline constexpr size_t kLensSurfacesMax = 256;

// name: of the file, for errors, which read "name:line:column: what".
// Errors: kInvalidArgument for malformed files and impossible lenses, kResourceExhausted beyond the
// limits; errors of opening and reading the file.
absl::StatusOr<std::vector<LensSurface>> ReadLens(const std::string& name, const std::string& path);

}  // namespace sheaf
