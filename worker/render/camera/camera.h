// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Camera: maps film points to rays. Perspective and orthographic cameras use a pinhole or a thin
// lens; spherical cameras see all directions; realistic ones trace through the surfaces of a lens.
// Axes and mappings are pbrt-v4's.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "common/scene/scene_description.h"
#include "worker/render/camera/aperture_shape.h"
#include "worker/render/camera/realistic_lens.h"
#include "worker/render/camera/shutter_shape.h"
#include "worker/render/geometry/animated_transform.h"
#include "worker/render/geometry/ray_origin.h"
#include "worker/render/geometry/surface_point.h"

namespace sheaf::render {

// How a camera sees a point along one ray. Space: render.
struct CameraConnection {
  Vec3f p_lens;  // The origin of the camera's ray that meets the point.
  Vec3f wi;      // Unit, from the point to p_lens.
  Vec2d film;    // Raster position of the ray; may lie outside of the frame.
  // The integral over the film, in pixels, of the weights of the rays that meet an area at the
  // point that faces p_lens, per such area; over the density with which p_lens was sampled. A
  // surface of radiance L there adds L * importance * |cos| * area to the pixel, on average over
  // lens and shutter.
  double importance = 0;
  // The same integral of the rays themselves: how many of them meet that area if each pixel sends
  // one. The two are equal but for realistic lenses, where rays have weights.
  double ray_density = 0;
};

class Camera {
 public:
  // render_origin_world: of render space. Errors: kInvalidArgument, with the
  // camera's location: a degenerate field of view or screen window, a lens that is focused at or
  // behind itself or is on a spherical camera, a transform that cannot be inverted. files: for the
  // image of a realistic camera's aperture; may be null otherwise.
  static absl::StatusOr<Camera> Make(const SceneDescription& scene, int32_t width_px,
                                     int32_t height_px, Vec3d render_origin_world,
                                     FileSource* files = nullptr);

  // Rays begin next to the ball of this radius about the origin, which contains all that they may
  // meet: the camera is so far away that floats there are too coarse. 0: at the camera.
  void set_ray_start_radius(double radius) { ray_start_radius_ = radius; }
  // The place from which the ray is seen: its origin, or that at the camera. ray: of MakeRay.
  Vec3f EyeOf(const Ray& ray) const { return ray_start_radius_ > 0 ? EyeOfFarRay(ray) : ray.o; }

  // film: raster position (pixels, y down). lens: in [0, 1)^2; unused without kLens. The ray's
  // direction is unit length. Space: render. Film points outside the frame, which a pixel filter
  // may reach, continue the image; those of a spherical camera wrap around to its other side.
  // *weight: factor of the ray's radiance, 1 except through a realistic lens; 0 where no light
  // passes, in which case the ray is unspecified.
  template <TraitBits kTraits>
  Ray MakeRay(Vec2d film, Vec2f lens, float shutter_fraction, float* weight = nullptr) const;
  // Connects p with a point of the lens, sampled as by MakeRay (uniformly on the frontmost surface
  // of a realistic lens); the inverse of MakeRay for cameras without a lens. None where the camera
  // does not see p. camera_importance.cc gives formulas and sources.
  std::optional<CameraConnection> SampleWi(Vec3f p, Vec2f lens, float shutter_fraction) const;
  // CameraConnection::ray_density where the ray, made by MakeRay, meets p; 0 where SampleWi finds
  // no connection.
  double PdfWe(const Ray& ray, Vec3f p) const;
  // The lens sample with which SampleWi connects a point on the ray of a realistic camera to the
  // ray's origin. None for other cameras, and if rays begin elsewhere (set_ray_start_radius).
  std::optional<Vec2f> LensSampleOf(const Ray& ray) const;
  // Where a ray of MakeRay, or one that continues it, meets the near and the far clip plane, in
  // lengths of its direction from its origin. Without a far plane it is infinitely far.
  bool HasNearClip() const { return near_clip_ > 0; }
  bool HasFarClip() const { return far_clip_ < std::numeric_limits<double>::infinity(); }
  double NearClip(const Ray& ray) const { return ReachOf(ray, near_clip_); }
  double FarClip(const Ray& ray) const { return ReachOf(ray, far_clip_); }
  // Samples a time in [0, 1) of the shutter interval in proportion to the shutter's opening.
  // Returns u itself where the shutter opens and closes instantly.
  float ShutterFraction(float u) const { return shutter_.empty() ? u : shutter_.Sample(u); }

  // Camera space: +z forward, x right, y up.
  Affine CameraFromRenderAt(float shutter_fraction) const {
    return Inverse(moves_ ? RenderFromCameraAt(shutter_fraction) : render_from_camera_);
  }
  // Projects p, in render space, to the film (through the center of a lens); none where it is
  // behind the camera. Requires: not a spherical or realistic camera.
  std::optional<Vec2d> FilmPointOf(Vec3d p, float shutter_fraction) const;

 private:
  using Kind = CameraDescription::Kind;
  absl::Status SetScreen(const CameraDescription& description, int32_t width_px, int32_t height_px);
  absl::Status SetLens(const CameraDescription& description);
  Affine RenderFromCameraAt(float shutter_fraction) const;
  // MakeRay of spherical and realistic cameras: a separate function, so that others do not pay for
  // the call.
  Ray MakeBentRay(Vec2d film, Vec2f lens, float shutter_fraction, float* weight) const;
  // The ray from o along d, unit.
  Ray RayFrom(Vec3d o, Vec3d d, float shutter_fraction) const {
    if (ray_start_radius_ > 0) o = o + d * std::max(0.0, -Dot(o, d) - 2 * ray_start_radius_);
    Ray ray;
    ray.o = ToFloat(o);
    ray.d = ToFloat(d);
    ray.time = shutter_fraction;
    return ray;
  }
  Vec3f EyeOfFarRay(const Ray& ray) const;
  // Where the ray is at this z of camera space; at this distance from a spherical camera.
  double ReachOf(const Ray& ray, double depth) const;
  // A connection in camera space: q - o is along `towards`, which need not be unit.
  struct Sight {
    Vec3d o, towards;
    Vec2d film;
    double importance = 0, ray_density = 0;
  };
  std::optional<Sight> SightOf(Vec3d q, Vec2f lens) const;
  Sight SightOnScreen(Vec3d q, Vec2d on_lens) const;
  Sight SightOnSphere(Vec3d q) const;
  std::optional<Sight> SightThroughLens(const std::optional<RealisticLens::Connection>& seen,
                                        Vec3d q) const;
  Vec2d PointOnLens(Vec2f lens) const {
    return (blades_.empty() ? SampleUnitDisk(lens) : blades_.Sample(lens)) * lens_radius_;
  }
  // Number of pixels per area of the screen.
  double PixelDensity() const { return std::fabs(1 / (screen_step_.x * screen_step_.y)); }

  Kind kind_ = Kind::kPerspective;
  bool bends_rays_ = false;  // Spherical and realistic cameras, which have no single screen.
  // Screen = origin + film * step: camera-space x, y at z = 1 (or on the plane); for spherical
  // cameras, a point of the map of all directions.
  Vec2d screen_origin_, screen_step_;
  std::shared_ptr<const RealisticLens> realistic_;  // Null for other kinds; shared, as it is large.
  double lens_radius_ = 0;
  BladePolygon blades_;                // The lens opening; empty: round.
  double inverse_focal_distance_ = 0;  // 0 for a lens focused at infinity.
  Affine render_from_camera_;
  bool moves_ = false;
  AnimatedTransform world_from_camera_;
  double shutter_open_ = 0, shutter_close_ = 0;
  ShutterShape shutter_;
  Vec3d render_origin_world_;
  double ray_start_radius_ = 0;
  double near_clip_ = 0, far_clip_ = std::numeric_limits<double>::infinity();
};

template <TraitBits kTraits>
Ray Camera::MakeRay(Vec2d film, Vec2f lens, float shutter_fraction, float* weight) const {
  if (bends_rays_) return MakeBentRay(film, lens, shutter_fraction, weight);
  const Vec2d screen{screen_origin_.x + film.x * screen_step_.x,
                     screen_origin_.y + film.y * screen_step_.y};
  Vec3d o, d{0, 0, 1};
  if (kind_ == Kind::kOrthographic) {
    o = {screen.x, screen.y, 0};
  } else {
    d = {screen.x, screen.y, 1};
  }
  if (Has(kTraits, Trait::kLens) && lens_radius_ > 0) {
    // All rays of a film point meet at z = F: subtracting lens / F from the direction avoids
    // division by a small number, and F = infinity gives parallel rays.
    const Vec2d on_lens = PointOnLens(lens);
    o = o + Vec3d{on_lens.x, on_lens.y, 0};
    d = d - Vec3d{on_lens.x, on_lens.y, 0} * inverse_focal_distance_;
  }
  if (Has(kTraits, Trait::kMotion) && moves_) {
    const Affine render_from_camera = RenderFromCameraAt(shutter_fraction);
    o = render_from_camera.Point(o);
    d = render_from_camera.Vector(d);
  } else {
    o = render_from_camera_.Point(o);
    d = render_from_camera_.Vector(d);
  }
  return RayFrom(o, Normalize(d), shutter_fraction);
}

}  // namespace sheaf::render
