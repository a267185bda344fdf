// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmissionMap: an image that a surface emits, over the surface's uv. By default as in pbrt-v4:
// bilinear, with edge texels repeated outside uv of [0, 1]. It also estimates the mean luminance of
// parts of the image, which weights the parts of a surface as lights.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

class EmissionMap {
 public:
  // texels: linear, row-major [height][width], top row first. Negative texels count as 0, as in
  // pbrt-v4. Errors: a texel that is not finite.
  static absl::StatusOr<EmissionMap> Make(int width, int height, std::vector<Rgb> texels);

  // The same image, placed otherwise. Both share its memory.
  EmissionMap Placed(const EmissionPlacement& placement) const;

  Rgb At(Vec2f uv) const;
  // Mean over the whole image. Luminance, per unit area of uv.
  double mean_luminance() const { return image_->mean_luminance; }
  // Approximate mean over a box of uv; positive if At is positive anywhere in the box. Cost:
  // bounded for any number of texels.
  double MeanLuminance(Vec2f lower, Vec2f upper) const;
  // The memory of the image, which maps of equal identity share.
  uint64_t memory_bytes() const;
  const void* image_identity() const { return image_.get(); }

 private:
  // Luminance, averaged over squares of 2^level texels.
  struct Level {
    int width = 0, height = 0;
    std::vector<float> means;
    float At(int x, int y) const {
      return means[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
    }
  };
  struct Image {
    int width = 0, height = 0;
    std::vector<Rgb> texels;
    std::vector<Level> levels;
    double mean_luminance = 0;
  };
  static void AddLevel(Image* image);
  Vec2f Mapped(Vec2f uv) const;

  std::shared_ptr<const Image> image_;
  EmissionPlacement placement_;
  bool has_mapping_ = false;
};

// By area light of the scene; null where the light has no image. Empty where no light has one.
using EmissionMaps = std::vector<std::shared_ptr<const EmissionMap>>;

// Reads each file once. Errors: those of ReadLightImage and EmissionMap::Make, with the light's
// location.
absl::StatusOr<EmissionMaps> ReadEmissionMaps(const SceneDescription& scene, FileSource& files);

}  // namespace sheaf::render
