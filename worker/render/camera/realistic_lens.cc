// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/camera/realistic_lens.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "worker/render/camera/aperture_shape.h"

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

std::optional<RealisticLens::Connection> RealisticLens::Connect(Vec3d q_mm, Vec2f u) const {
  const Vec2d on_front = SampleUnitDisk(u) * lens_.front_radius_mm();
  return ConnectThrough(q_mm, on_front);
}

// The film integrates radiance over its etendue, dG = cos dA dw. A lens without losses keeps
// dG times the squared index (Winston, Minano and Benitez 2005, "Nonimaging Optics", sec. 2.7), so
// the integral may be taken over the frontmost surface instead, where dA = dx dy / n.z.
std::optional<RealisticLens::Connection> RealisticLens::ConnectThrough(Vec3d q_mm,
                                                                       Vec2d front_mm) const {
  const std::optional<LensSystem::FrontPoint> front = lens_.FrontAt(front_mm);
  if (!front) return std::nullopt;
  const Vec3d to_front = front->p - q_mm;
  const double square = LengthSquared(to_front);
  LensRay ray{q_mm, to_front / std::sqrt(square)};
  const double facing = -Dot(ray.d, front->n);
  if (!(facing > 0 && ray.d.z < 0)) return std::nullopt;
  const double transmission = lens_.TraceToFilm(&ray);
  if (!(transmission > 0)) return std::nullopt;
  const auto at_z = [&ray](double z) {
    const double t = (z - ray.o.z) / ray.d.z;
    return Vec2d{ray.o.x + t * ray.d.x, ray.o.y + t * ray.d.y};
  };
  const Vec2d at = at_z(0);
  const double z = lens_.rear_z_mm();
  const double pupil_pdf = pupil_.Pdf(at, at_z(z));
  if (!(pupil_pdf > 0)) return std::nullopt;
  const double radius = lens_.front_radius_mm();
  const double opening = std::numbers::pi * radius * radius;
  const double etendue = lens_.FilmEtendueFactor() * opening * facing / (front->n.z * square);
  const double cos_squared = ray.d.z * ray.d.z;
  Connection connection;
  connection.front = front->p;
  connection.film = {0.5 - at.x / extent_mm_.x, 0.5 + at.y / extent_mm_.y};
  connection.importance = transmission * etendue / (extent_mm_.x * extent_mm_.y);
  connection.ray_density =
      etendue / (extent_mm_.x * extent_mm_.y) * pupil_pdf * z * z / (cos_squared * cos_squared);
  return connection;
}

}  // namespace sheaf::render
