// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Builds cameras from their descriptions.
#include "worker/render/camera/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/math/elementary.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

// Maps x to [0, 1] by half-turns about the centers of the square's two vertical edges, which map
// the rest of the plane to the square; y is rotated along.
void WrapAcrossEdges(double* x, double* y) {
  *x -= 2 * std::floor(0.5 * *x);
  if (*x > 1) {
    *x = 2 - *x;
    *y = 1 - *y;
  }
}

// The point of the equal-area map at p when the map is continued beyond its edges: each edge is
// folded at its middle, so that its halves meet, and all corners are one direction.
Vec2d WrapOctahedrally(Vec2d p) {
  WrapAcrossEdges(&p.x, &p.y);
  WrapAcrossEdges(&p.y, &p.x);
  return p;
}

// Unit directions in camera space for points of [0, 1]^2 on a map of all directions, continued
// outside the square. Both maps are about +z but cameras about +y, as in pbrt-v4: exchange the two.
Vec3d EqualAreaDirection(Vec2d screen) {
  const Vec3d d = EqualAreaSquareToSphere(WrapOctahedrally(screen));
  return {d.x, d.z, d.y};
}
Vec3d EquirectangularDirection(Vec2d screen) {
  // Beyond the pole sin theta is negative, which gives the correct, opposite side.
  const SinCosPair<double> theta = SinCos(std::numbers::pi * screen.y);
  const SinCosPair<double> phi = SinCos(2 * std::numbers::pi * screen.x);
  return {theta.sin * phi.cos, theta.cos, theta.sin * phi.sin};
}

}  // namespace

absl::StatusOr<Camera> Camera::Make(const SceneDescription& scene, int32_t width_px,
                                    int32_t height_px, Vec3d render_origin_world,
                                    FileSource* files) {
  const CameraDescription& description = scene.camera;
  const auto fail = [&](const absl::Status& status) {
    return Annotate(status, absl::StrCat(FormatLocation(scene, description.location), ": Camera"));
  };
  Camera camera;
  camera.kind_ = description.kind;
  camera.bends_rays_ = description.IsSpherical() || description.IsRealistic();
  absl::Status status = camera.SetScreen(description, width_px, height_px);
  if (status.ok()) status = camera.SetLens(description);
  if (!status.ok()) return fail(status);
  if (description.IsRealistic()) {
    absl::StatusOr<RealisticLens> lens = RealisticLens::Make(scene, width_px, height_px, files);
    if (!lens.ok()) return fail(lens.status());
    camera.realistic_ = std::make_shared<const RealisticLens>(*std::move(lens));
  }
  absl::StatusOr<ShutterShape> shutter = ShutterShape::Make(description.shutter_shape);
  if (!shutter.ok()) return fail(shutter.status());
  camera.shutter_ = *std::move(shutter);
  absl::StatusOr<AnimatedTransform> transform =
      AnimatedTransform::Make(description.world_from_camera);
  if (!transform.ok()) return fail(transform.status());
  camera.world_from_camera_ = *transform;
  camera.shutter_open_ = description.shutter_open;
  camera.shutter_close_ = std::max(description.shutter_open, description.shutter_close);
  camera.moves_ =
      description.world_from_camera.IsAnimated() && camera.shutter_close_ > camera.shutter_open_;
  camera.render_origin_world_ = render_origin_world;
  camera.near_clip_ = static_cast<double>(description.near_clip);
  camera.far_clip_ = static_cast<double>(description.far_clip);
  camera.render_from_camera_ = camera.RenderFromCameraAt(0);
  return camera;
}

absl::Status Camera::SetScreen(const CameraDescription& description, int32_t width_px,
                               int32_t height_px) {
  if (bends_rays_) {
    screen_origin_ = {0, 0};
    screen_step_ = {1.0 / width_px, 1.0 / height_px};
    return absl::OkStatus();
  }
  double scale = 1;
  if (kind_ == Kind::kPerspective) {
    if (!(description.fov_degrees > 0 && description.fov_degrees < 180)) {
      return absl::InvalidArgumentError(
          absl::StrCat("\"float fov\" ", description.fov_degrees, " is outside (0, 180) degrees"));
    }
    scale = Tan(0.5 * static_cast<double>(description.fov_degrees) * (std::numbers::pi / 180));
  }
  const double* window = description.screen_window;
  const double step_x = scale * (window[1] - window[0]) / width_px;
  const double step_y = scale * (window[3] - window[2]) / height_px;
  if (!std::isfinite(step_x) || !std::isfinite(step_y) || step_x == 0 || step_y == 0) {
    return absl::InvalidArgumentError("\"float screenwindow\" is empty or not finite");
  }
  screen_origin_ = {scale * window[0], scale * window[3]};
  screen_step_ = {step_x, -step_y};
  return absl::OkStatus();
}

absl::Status Camera::SetLens(const CameraDescription& description) {
  if (description.IsRealistic()) return absl::OkStatus();
  lens_radius_ = description.lens_radius;
  if (!(lens_radius_ > 0)) return absl::OkStatus();
  if (description.IsSpherical()) {
    return absl::InvalidArgumentError("\"float lensradius\": a spherical camera has no lens");
  }
  if (!(description.focal_distance > 0)) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"float focaldistance\" ", description.focal_distance,
                     " must be above 0 where \"float lensradius\" is"));
  }
  if (description.blade_count >= 3) {
    blades_ = BladePolygon(description.blade_count,
                           static_cast<double>(description.blade_rotation_degrees));
  }
  inverse_focal_distance_ = 1 / static_cast<double>(description.focal_distance);
  return absl::OkStatus();
}

Ray Camera::MakeBentRay(Vec2d film, Vec2f lens, float shutter_fraction, float* weight) const {
  const Vec2d screen{film.x * screen_step_.x, film.y * screen_step_.y};
  Vec3d o, d;
  if (realistic_ != nullptr) {
    LensRay bent;
    const double lens_weight = realistic_->MakeRay(screen, lens, &bent);
    if (weight != nullptr) *weight = static_cast<float>(lens_weight);
    if (lens_weight == 0) return {};
    o = bent.o * 0.001;  // These scenes are in meters.
    d = bent.d;
  } else {
    d = kind_ == Kind::kEqualArea ? EqualAreaDirection(screen) : EquirectangularDirection(screen);
  }
  const Affine render_from_camera =
      moves_ ? RenderFromCameraAt(shutter_fraction) : render_from_camera_;
  return RayFrom(render_from_camera.Point(o), Normalize(render_from_camera.Vector(d)),
                 shutter_fraction);
}

Vec3f Camera::EyeOfFarRay(const Ray& ray) const {
  const Affine render_from_camera = moves_ ? RenderFromCameraAt(ray.time) : render_from_camera_;
  // Back to the plane of the camera; a lens or a sphere of directions is small beside the distance.
  const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d), axis = render_from_camera.z;
  const double back = Dot(o - render_from_camera.offset, axis) / Dot(d, axis);
  if (bends_rays_ || !(back > 0)) return ToFloat(render_from_camera.offset);
  return ToFloat(o - d * back);
}

double Camera::ReachOf(const Ray& ray, double depth) const {
  const Affine camera_from_render = CameraFromRenderAt(ray.time);
  const Vec3d o = camera_from_render.Point(ToDouble(ray.o)),
              d = camera_from_render.Vector(ToDouble(ray.d));
  if (!bends_rays_ || realistic_ != nullptr) return (depth - o.z) / d.z;
  return depth / Length(d) - Dot(o, d) / LengthSquared(d);
}

std::optional<Vec2d> Camera::FilmPointOf(Vec3d p, float shutter_fraction) const {
  const Vec3d q = CameraFromRenderAt(shutter_fraction).Point(p);
  Vec2d screen{q.x, q.y};
  if (kind_ == Kind::kPerspective) {
    if (!(q.z > 0)) return std::nullopt;
    screen = {q.x / q.z, q.y / q.z};
  }
  return Vec2d{(screen.x - screen_origin_.x) / screen_step_.x,
               (screen.y - screen_origin_.y) / screen_step_.y};
}

Affine Camera::RenderFromCameraAt(float shutter_fraction) const {
  Affine transform = world_from_camera_.At(
      shutter_open_ + (shutter_close_ - shutter_open_) * static_cast<double>(shutter_fraction));
  transform.offset = transform.offset - render_origin_world_;
  return transform;
}

}  // namespace sheaf::render
