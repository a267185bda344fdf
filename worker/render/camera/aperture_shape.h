// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What the opening of a lens looks like: blades of a thin lens, and the stops of pbrt-v4's
// realistic camera.
#pragma once

#include <algorithm>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

// Uniform in area on the unit disk. Source: Shirley and Chiu 1997.
struct DiskPoint {
  double radius = 0, angle = 0;  // The radius has a sign: below 0 it is half a turn further.
};
DiskPoint SampleUnitDiskPolar(Vec2f u);
Vec2d SampleUnitDisk(Vec2f u);

// A regular polygon in the unit circle, as straight blades leave it.
class BladePolygon {
 public:
  BladePolygon() = default;
  // rotation_degrees: of the first corner from +x towards +y. Requires: blade_count >= 3.
  BladePolygon(int blade_count, double rotation_degrees);
  bool empty() const { return corners_.empty(); }
  // Uniform in area. The concentric map of the disk, each of its sectors stretched to a triangle:
  // continuous, and the density is the same everywhere, so that stratified points stay so. Source:
  // Shirley and Chiu 1997.
  Vec2d Sample(Vec2f u) const;

 private:
  std::vector<Vec2d> corners_;  // The first one again at the end.
};

// How much of the light a stop lets pass where its opening has the unit circle; all shapes let as
// much through in all as the disk does.
class ApertureMask {
 public:
  // Errors: those of reading the picture, or where it is all black.
  static absl::StatusOr<ApertureMask> Make(const SceneDescription& scene, FileSource* files);
  // p: in camera space (x right, y up as the camera looks), over the stop's radius.
  double Transmission(Vec2d p) const;
  // Nothing passes outside of the disk.
  double BoundingRadiusSquared() const {
    if (aperture_ != Aperture::kPicture) return 1;
    // The square's corners, and half a texel, which the filter adds.
    const double edge = 1 + 1.0 / std::min(width_, height_);
    return 2 * edge * edge;
  }

 private:
  using Aperture = LensDescription::Aperture;
  bool IsInPolygon(Vec2d p) const;
  double LookUp(Vec2d p) const;

  Aperture aperture_ = Aperture::kDisk;
  double scale_ = 1;
  std::vector<Vec2d> polygon_;  // Closed: the first corner again at the end.
  int width_ = 0, height_ = 0;  // Of the picture, [height][width], bottom row first.
  std::vector<float> texels_;
};

}  // namespace sheaf::render
