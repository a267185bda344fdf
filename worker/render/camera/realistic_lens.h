// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RealisticLens: film points to rays through a lens and their weights, which together measure, as
// pbrt-v4's realistic camera does, the irradiance on the film where all around is of radiance 1:
// cos^4 over the squared distance to the pupil's plane, over the pdf of the point there.
#pragma once

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/camera/exit_pupil.h"
#include "worker/render/camera/lens_system.h"

namespace sheaf::render {

class RealisticLens {
 public:
  // files: to read a picture of the aperture from. Errors: those of LensSystem::Make and
  // ApertureMask::Make; without the camera's location for those of the lens.
  static absl::StatusOr<RealisticLens> Make(const SceneDescription& scene, int32_t width_px,
                                            int32_t height_px, FileSource* files);
  // film: of [0, 1]^2 over the frame, y down; as far beyond as the pixel filter reaches. 0 where no
  // light comes that way, and *ray is unspecified then. Space: camera, millimetres.
  double MakeRay(Vec2d film, Vec2f u, LensRay* ray) const;

  const LensSystem& lens() const { return lens_; }
  const ExitPupil& pupil() const { return pupil_; }
  // Where on the film, seen from behind, a picture's point is: the lens turns it round.
  Vec2d FilmPoint(Vec2d film) const {
    return {(0.5 - film.x) * extent_mm_.x, (film.y - 0.5) * extent_mm_.y};
  }
  Vec2d extent_mm() const { return extent_mm_; }

 private:
  LensSystem lens_;
  ExitPupil pupil_;
  Vec2d extent_mm_;
};

}  // namespace sheaf::render
