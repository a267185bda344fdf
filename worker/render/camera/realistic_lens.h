// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RealisticLens: maps film points to rays through a lens, with weights. As in pbrt-v4's realistic
// camera, the weights measure the irradiance on the film under constant radiance 1: cos^4 over the
// squared distance to the pupil's plane, over the pdf of the point there.
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
  // files: for the image of the aperture. Errors: those of LensSystem::Make (without the camera's
  // location) and of ApertureMask::Make.
  static absl::StatusOr<RealisticLens> Make(const SceneDescription& scene, int32_t width_px,
                                            int32_t height_px, FileSource* files);
  // film: in [0, 1]^2 over the frame, y down; beyond it as far as the pixel filter extends. Returns
  // 0 where no light passes; *ray is then unspecified. Space: camera, millimeters.
  double MakeRay(Vec2d film, Vec2f u, LensRay* ray) const;

  const LensSystem& lens() const { return lens_; }
  const ExitPupil& pupil() const { return pupil_; }
  // Position on the film, seen from behind, of an image point: the lens inverts the image.
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
