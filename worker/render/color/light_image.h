// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightImage: an image file read as linear radiance for a light.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

// Linear sRGB, row-major [height][width], top row first. Files that specify other primaries are
// converted; components that become negative are clamped to 0, with a warning.
struct LightImage {
  int width = 0, height = 0;
  std::vector<Rgb> texels;
};

// location: of the light; messages begin with it. Errors: those of ReadImage; a side beyond
// kLightImageSideMax.
absl::StatusOr<LightImage> ReadLightImage(const SceneDescription& scene, SourceLocation location,
                                          const std::string& file, FileSource& files);

}  // namespace sheaf::render
