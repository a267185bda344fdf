// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RealisticLens: maps film points to rays through a lens, with weights. As in pbrt-v4's realistic
// camera, the weights measure the irradiance on the film under constant radiance 1: cos^4 over the
// squared distance to the pupil's plane, over the pdf of the point there.
#pragma once

#include <optional>

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

  // How the film sees a point q in front of the lens through a point of the frontmost surface.
  struct Connection {
    Vec3d front;             // Space: camera, millimeters.
    Vec2d film;              // As for MakeRay; may lie far outside of the frame.
    double importance = 0;   // Weights of rays, integrated over the film, per area at q that faces
                             // `front` (1/mm^2), over the density with which Connect chose `front`.
    double ray_density = 0;  // The same for a weight of 1: the density of MakeRay's rays.
  };
  // Chooses a point of the frontmost surface, uniformly as seen along the axis. None where no light
  // passes. q_mm: space: camera, millimeters.
  std::optional<Connection> Connect(Vec3d q_mm, Vec2f u) const;
  // The same for a known point of the frontmost surface, by its distances from the axis.
  std::optional<Connection> ConnectThrough(Vec3d q_mm, Vec2d front_mm) const;

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
