// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightImage: an image file read as linear radiance for a light.
#pragma once

#include <cstdint>
#include <set>
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

// The limit counts files that were read before: lights that differ otherwise have an image each.
inline constexpr uint64_t kRepeatedTexelsMax = uint64_t{1} << 28;

// The images of a scene's lights, of which each may name the same large file.
class LightImages {
 public:
  // All arguments must outlive this.
  LightImages(const SceneDescription& scene, FileSource& files,
              uint64_t repeated_texels_max = kRepeatedTexelsMax)
      : scene_(scene), files_(files), repeated_texels_max_(repeated_texels_max) {}

  // As ReadLightImage. Errors: also kResourceExhausted beyond the texels that are read again.
  absl::StatusOr<LightImage> Read(SourceLocation location, const std::string& file);

 private:
  const SceneDescription& scene_;
  FileSource& files_;
  const uint64_t repeated_texels_max_;
  uint64_t repeated_texels_ = 0;
  std::set<std::string> read_;
};

}  // namespace sheaf::render
