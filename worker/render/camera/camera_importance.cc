// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The importance of cameras: how a point is seen, the inverse of Camera::MakeRay. In camera space a
// small area that faces the lens covers these pixels, per area, at z in front of the lens and at
// the angle t to the axis:
//   perspective      pixels per screen area / (z^2 cos t)
//   orthographic     pixels per screen area / cos t
//   equal-area       pixels / (4 pi r^2)
//   equirectangular  pixels / (2 pi^2 r^2 sin theta), theta from the pole
// A lens changes z and t only, because all of its rays pass the focal plane as the pinhole's do.
// A transform M from camera to render space multiplies the area that faces the unit vector d by
// |det M| / |M d|. Source: Pharr, Jakob and Humphreys, "Physically Based Rendering", 3rd ed.,
// sec. 16.1.1, here for all cameras and transforms.
#include <cmath>
#include <numbers>

#include "common/math/elementary.h"
#include "worker/render/camera/camera.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

constexpr double kMillimeters = 1000;  // Per unit of scenes with realistic cameras.

}  // namespace

// Requires: q.z > 0.
Camera::Sight Camera::SightOnScreen(Vec3d q, Vec2d on_lens) const {
  const Vec2d bend = on_lens * inverse_focal_distance_;
  Sight sight;
  Vec2d screen;
  if (kind_ == Kind::kOrthographic) {
    sight.towards = {-bend.x, -bend.y, 1};
    sight.o = {q.x - q.z * sight.towards.x, q.y - q.z * sight.towards.y, 0};
    screen = Vec2d{sight.o.x, sight.o.y} - on_lens;
    sight.importance = PixelDensity() * Length(sight.towards);
  } else {
    sight.o = {on_lens.x, on_lens.y, 0};
    sight.towards = {(q.x - on_lens.x) / q.z, (q.y - on_lens.y) / q.z, 1};
    screen = Vec2d{sight.towards.x, sight.towards.y} + bend;
    sight.importance = PixelDensity() * Length(sight.towards) / (q.z * q.z);
  }
  sight.film = {(screen.x - screen_origin_.x) / screen_step_.x,
                (screen.y - screen_origin_.y) / screen_step_.y};
  sight.ray_density = sight.importance;
  return sight;
}

// Requires: q is not the origin.
Camera::Sight Camera::SightOnSphere(Vec3d q) const {
  const double square = LengthSquared(q);
  Sight sight;
  sight.towards = q;
  Vec2d screen;
  if (kind_ == Kind::kEqualArea) {
    const Vec3d d = q / std::sqrt(square);
    const Vec2f st = EqualAreaSphereToSquare(ToFloat({d.x, d.z, d.y}));
    screen = {static_cast<double>(st.x), static_cast<double>(st.y)};
    sight.importance = PixelDensity() / (4 * kPi * square);
  } else {
    const double from_axis = std::sqrt(q.x * q.x + q.z * q.z);
    const double phi = Atan2(q.z, q.x);
    screen = {(phi < 0 ? phi + 2 * kPi : phi) / (2 * kPi), Atan2(from_axis, q.y) / kPi};
    sight.importance = PixelDensity() / (2 * kPi * kPi * std::sqrt(square) * from_axis);
  }
  sight.film = {screen.x / screen_step_.x, screen.y / screen_step_.y};
  sight.ray_density = sight.importance;
  return sight;
}

std::optional<Camera::Sight> Camera::SightThroughLens(
    const std::optional<RealisticLens::Connection>& seen, Vec3d q) const {
  if (!seen) return std::nullopt;
  Sight sight;
  sight.o = seen->front / kMillimeters;
  sight.towards = q - sight.o;
  sight.film = {seen->film.x / screen_step_.x, seen->film.y / screen_step_.y};
  const double pixels = PixelDensity() * kMillimeters * kMillimeters;
  sight.importance = seen->importance * pixels;
  sight.ray_density = seen->ray_density * pixels;
  return sight;
}

std::optional<Camera::Sight> Camera::SightOf(Vec3d q, Vec2f lens) const {
  if (realistic_ != nullptr) {
    return SightThroughLens(realistic_->Connect(q * kMillimeters, lens), q);
  }
  if (bends_rays_) {
    if (!(LengthSquared(q) > 0)) return std::nullopt;
    return SightOnSphere(q);
  }
  if (!(q.z > 0)) return std::nullopt;
  return SightOnScreen(q, lens_radius_ > 0 ? PointOnLens(lens) : Vec2d{});
}

std::optional<CameraConnection> Camera::SampleWi(Vec3f p, Vec2f lens,
                                                 float shutter_fraction) const {
  const Affine render_from_camera =
      moves_ ? RenderFromCameraAt(shutter_fraction) : render_from_camera_;
  const std::optional<Sight> sight = SightOf(Inverse(render_from_camera).Point(ToDouble(p)), lens);
  if (!sight) return std::nullopt;
  const Vec3d o = render_from_camera.Point(sight->o);
  const Vec3d to_lens = o - ToDouble(p);
  const double distance = Length(to_lens);
  const double area_factor = Length(render_from_camera.Vector(sight->towards)) /
                             (Length(sight->towards) * std::fabs(render_from_camera.Determinant()));
  CameraConnection connection;
  connection.p_lens = ToFloat(o);
  connection.wi = ToFloat(to_lens / distance);
  connection.film = sight->film;
  connection.importance = sight->importance * area_factor;
  connection.ray_density = sight->ray_density * area_factor;
  const bool usable = connection.importance > 0 && std::isfinite(connection.importance) &&
                      std::isfinite(connection.ray_density) && distance > 0 &&
                      std::isfinite(distance);
  return usable ? std::optional(connection) : std::nullopt;
}

std::optional<Vec2f> Camera::LensSampleOf(const Ray& ray) const {
  if (realistic_ == nullptr || ray_start_radius_ > 0) return std::nullopt;
  const Vec3d o = CameraFromRenderAt(ray.time).Point(ToDouble(ray.o)) * kMillimeters;
  return UnitSquareOfDisk(Vec2d{o.x, o.y} * (1 / realistic_->lens().front_radius_mm()));
}

double Camera::PdfWe(const Ray& ray, Vec3f p) const {
  const Affine render_from_camera = moves_ ? RenderFromCameraAt(ray.time) : render_from_camera_;
  const Affine camera_from_render = Inverse(render_from_camera);
  const Vec3d q = camera_from_render.Point(ToDouble(p));
  std::optional<Sight> sight;
  if (realistic_ != nullptr) {
    const Vec3d o = camera_from_render.Point(ToDouble(ray.o)) * kMillimeters;
    sight = SightThroughLens(realistic_->ConnectThrough(q * kMillimeters, {o.x, o.y}), q);
  } else if (bends_rays_) {
    if (LengthSquared(q) > 0) sight = SightOnSphere(q);
  } else if (q.z > 0) {
    // The point of the lens follows from the ray: its origin, or what bends it.
    const Vec3d o = camera_from_render.Point(ToDouble(ray.o));
    const Vec3d d = camera_from_render.Vector(ToDouble(ray.d));
    Vec2d on_lens{o.x, o.y};
    if (kind_ == Kind::kOrthographic) {
      on_lens = Vec2d{-d.x, -d.y} *
                (inverse_focal_distance_ > 0 ? 1 / (d.z * inverse_focal_distance_) : 0);
    }
    sight = SightOnScreen(q, on_lens);
  }
  if (!sight) return 0;
  const double density = sight->ray_density * Length(render_from_camera.Vector(sight->towards)) /
                         (Length(sight->towards) * std::fabs(render_from_camera.Determinant()));
  return std::isfinite(density) ? density : 0;
}

}  // namespace sheaf::render
