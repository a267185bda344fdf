// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/visible_emitters.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <variant>

#include "common/math/elementary.h"
#include "common/math/transform.h"

namespace sheaf {
namespace {

// Bounds beyond this are useless as pixels.
constexpr double kFilmPxMax = 1 << 24;

struct Box {
  Vec3d low, high;
};

// Bounds in the shape's own space; none if they change with time or are unknown.
class BoundsOfShape {
 public:
  explicit BoundsOfShape(const SceneDescription& scene) : scene_(scene) {}

  std::optional<Box> operator()(const SphereShape& sphere) const {
    const double r = sphere.radius;
    return Box{{-r, -r, -r}, {r, r, r}};
  }
  std::optional<Box> operator()(const DiskShape& disk) const {
    const double r = disk.radius, z = disk.height;
    return Box{{-r, -r, z}, {r, r, z}};
  }
  std::optional<Box> operator()(const CylinderShape& cylinder) const {
    const double r = cylinder.radius;
    return Box{{-r, -r, cylinder.z_min}, {r, r, cylinder.z_max}};
  }
  std::optional<Box> operator()(const MeshShape& shape) const {
    const TriangleMesh& mesh = scene_.meshes[static_cast<size_t>(shape.mesh)];
    if (shape.IsDisplaced() || !mesh.steps.empty()) return std::nullopt;
    return Around(mesh.positions);
  }
  std::optional<Box> operator()(const BilinearMeshShape& shape) const {
    return Around(scene_.bilinear_meshes[static_cast<size_t>(shape.mesh)].positions);
  }
  std::optional<Box> operator()(const CurveShape&) const { return std::nullopt; }

 private:
  static std::optional<Box> Around(std::span<const Vec3f> points) {
    if (points.empty()) return std::nullopt;
    const auto wide = [](Vec3f p) { return Vec3d{p.x, p.y, p.z}; };
    Box box{wide(points.front()), wide(points.front())};
    for (const Vec3f& point : points) {
      const Vec3d p = wide(point);
      box.low = {std::min(box.low.x, p.x), std::min(box.low.y, p.y), std::min(box.low.z, p.z)};
      box.high = {std::max(box.high.x, p.x), std::max(box.high.y, p.y), std::max(box.high.z, p.z)};
    }
    return box;
  }

  const SceneDescription& scene_;
};

// Maps camera space to the pixels of the film, in the same way as the camera (worker/render).
class Film {
 public:
  Film(const CameraDescription& camera, int32_t width_px, int32_t height_px)
      : is_perspective_(camera.kind == CameraDescription::Kind::kPerspective) {
    if (is_perspective_) {
      scale_ = Tan(static_cast<double>(camera.fov_degrees) * (std::numbers::pi / 360));
    }
    const double* window = camera.screen_window;
    x0_ = window[0];
    y1_ = window[3];
    x_px_ = width_px / (window[1] - window[0]);
    y_px_ = height_px / (window[3] - window[2]);
  }

  // Bounds of the eight corners; none if a corner is not in front of the camera.
  std::optional<PixelRect> BoundsOf(const Box& box, const Matrix4& camera_from_box) const {
    double low_x = kFilmPxMax, low_y = kFilmPxMax, high_x = -kFilmPxMax, high_y = -kFilmPxMax;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3d p = TransformPoint(camera_from_box, {(corner & 1) != 0 ? box.high.x : box.low.x,
                                                       (corner & 2) != 0 ? box.high.y : box.low.y,
                                                       (corner & 4) != 0 ? box.high.z : box.low.z});
      if (!(p.z > 0)) return std::nullopt;
      const double depth = is_perspective_ ? p.z : 1;
      const double x = (p.x / depth / scale_ - x0_) * x_px_;
      const double y = (y1_ - p.y / depth / scale_) * y_px_;
      if (!(std::fabs(x) < kFilmPxMax && std::fabs(y) < kFilmPxMax)) return std::nullopt;
      low_x = std::min(low_x, x);
      low_y = std::min(low_y, y);
      high_x = std::max(high_x, x);
      high_y = std::max(high_y, y);
    }
    const auto down = [](double px) { return static_cast<int32_t>(std::floor(px)); };
    return PixelRect{down(low_x), down(low_y), down(high_x) + 1, down(high_y) + 1};
  }

 private:
  bool is_perspective_;
  double scale_ = 1;
  double x0_, y1_;
  double x_px_, y_px_;  // Pixels per unit of the screen.
};

}  // namespace

std::vector<PixelRect> VisibleEmitters(const SceneDescription& scene, int32_t width_px,
                                       int32_t height_px) {
  const CameraDescription& camera = scene.camera;
  Matrix4 camera_from_world;
  if (camera.IsSpherical() || camera.IsRealistic() || camera.world_from_camera.IsAnimated() ||
      !Invert(camera.world_from_camera.start, &camera_from_world)) {
    return {};
  }
  const Film film(camera, width_px, height_px);
  std::vector<PixelRect> emitters;
  for (const int32_t index : scene.world_shapes) {
    const ShapeDescription& shape = scene.shapes[static_cast<size_t>(index)];
    if (shape.area_light == kNone || shape.world_from_object.IsAnimated()) continue;
    const std::optional<Box> box = std::visit(BoundsOfShape(scene), shape.shape);
    if (!box) continue;
    const std::optional<PixelRect> rect =
        film.BoundsOf(*box, camera_from_world * shape.world_from_object.start);
    if (rect) emitters.push_back(*rect);
  }
  return emitters;
}

}  // namespace sheaf
