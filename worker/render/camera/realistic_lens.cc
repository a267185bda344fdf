// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/camera/realistic_lens.h"

#include <cmath>
#include <utility>

namespace sheaf::render {

absl::StatusOr<RealisticLens> RealisticLens::Make(const SceneDescription& scene, int32_t width_px,
                                                  int32_t height_px, FileSource* files) {
  absl::StatusOr<ApertureMask> mask = ApertureMask::Make(scene, files);
  if (!mask.ok()) return mask.status();
  absl::StatusOr<LensSystem> lens = LensSystem::Make(scene.camera.lens, *std::move(mask));
  if (!lens.ok()) return lens.status();
  RealisticLens made;
  made.lens_ = *std::move(lens);
  const double aspect = static_cast<double>(height_px) / width_px;
  made.extent_mm_.x =
      static_cast<double>(scene.camera.lens.film_diagonal_mm) / std::sqrt(1 + aspect * aspect);
  made.extent_mm_.y = aspect * made.extent_mm_.x;
  const double pixel_mm = made.extent_mm_.x / width_px;
  const double x = 0.5 * made.extent_mm_.x + pixel_mm * double{scene.filter.radius_x_px};
  const double y = 0.5 * made.extent_mm_.y + pixel_mm * double{scene.filter.radius_y_px};
  made.pupil_ = ExitPupil(made.lens_, std::sqrt(x * x + y * y));
  return made;
}

double RealisticLens::MakeRay(Vec2d film, Vec2f u, LensRay* ray) const {
  const Vec2d at = FilmPoint(film);
  const PupilSample pupil = pupil_.Sample(at, u);
  const double z = lens_.rear_z_mm();
  *ray = {{at.x, at.y, 0}, Normalize(Vec3d{pupil.p_mm.x - at.x, pupil.p_mm.y - at.y, z})};
  const double cos_squared = ray->d.z * ray->d.z;
  const double transmission = lens_.TraceFromFilm(ray);
  return transmission * cos_squared * cos_squared / (pupil.pdf_per_mm2 * z * z);
}

}  // namespace sheaf::render
