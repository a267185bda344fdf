// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightImage: a picture read as light.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

// Pictures wider or higher than this are larger than a worker should hold: 12 to 18 bytes a pixel.
inline constexpr int kLightImageSizeMax = 8192;

// Linear sRGB, row-major [height][width], top row first. Files that say so may have other
// primaries; negative components that this leaves become 0, with a warning.
struct LightImage {
  int width = 0, height = 0;
  std::vector<Rgb> texels;
};

// location: of the light, with which messages begin. Errors: a file that is missing, cannot be
// decoded, is larger than kLightImageSizeMax, or has two channels.
absl::StatusOr<LightImage> ReadLightImage(const SceneDescription& scene, SourceLocation location,
                                          const std::string& file, FileSource& files);

}  // namespace sheaf::render
