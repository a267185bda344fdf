// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Shapes of a lens opening: the blades of a thin lens, and the stops of pbrt-v4's realistic camera.
#pragma once

#include <algorithm>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

// Uniform by area on the unit disk. Source: Shirley and Chiu 1997.
struct DiskPoint {
  double radius = 0, angle = 0;  // The radius is signed: below 0, the point is half a turn further.
};
DiskPoint SampleUnitDiskPolar(Vec2f u);
Vec2d SampleUnitDisk(Vec2f u);
// The inverse of SampleUnitDisk: in [0, 1)^2. Requires: p is in the unit disk, or next to it.
Vec2f UnitSquareOfDisk(Vec2d p);

// A regular polygon in the unit circle: the opening of straight blades.
class BladePolygon {
 public:
  BladePolygon() = default;
  // rotation_degrees: of the first corner from +x towards +y. Requires: blade_count >= 3.
  BladePolygon(int blade_count, double rotation_degrees);
  bool empty() const { return corners_.empty(); }
  // Samples uniformly by area. The concentric map of the disk, with each sector stretched to a
  // triangle: continuous and of constant density, so that stratified points stay stratified.
  // Source: Shirley and Chiu 1997.
  Vec2d Sample(Vec2f u) const;

 private:
  std::vector<Vec2d> corners_;  // Closed: repeats the first one at the end.
};

// Transmittance of a stop whose opening fits the unit circle; all shapes transmit the same total as
// the disk.
class ApertureMask {
 public:
  // Errors: those of reading the image, or an image that is all black.
  static absl::StatusOr<ApertureMask> Make(const SceneDescription& scene, FileSource* files);
  // p: in camera space (x right, y up as seen along the view), divided by the stop's radius.
  double Transmission(Vec2d p) const;
  // Squared radius of a disk that bounds the opening.
  double BoundingRadiusSquared() const {
    if (aperture_ != Aperture::kImage) return 1;
    // The square's corners, plus half a texel for the filter.
    const double edge = 1 + 1.0 / std::min(width_, height_);
    return 2 * edge * edge;
  }

 private:
  using Aperture = LensDescription::Aperture;
  bool IsInPolygon(Vec2d p) const;
  double LookUp(Vec2d p) const;

  Aperture aperture_ = Aperture::kDisk;
  double scale_ = 1;
  std::vector<Vec2d> polygon_;  // Closed: repeats the first corner at the end.
  int width_ = 0, height_ = 0;  // Image size; [height][width], bottom row first.
  std::vector<float> texels_;
};

}  // namespace sheaf::render
