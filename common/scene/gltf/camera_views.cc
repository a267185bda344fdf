// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/camera_views.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/nearest_name.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

constexpr int32_t kDefaultWidth = 1280, kDefaultHeight = 720;
constexpr double kDegrees = 57.29577951308232;
constexpr double kAspectMin = 0.01, kAspectMax = 100;
// The camera that frames a scene: full angle of its height, and the air around the scene.
constexpr double kDefaultFov = 0.7, kAir = 1.1;

// The axes of the node without its scales: x right, y up, looking along +z (glTF: along -z).
Matrix4 WorldFromCamera(const Matrix4& node) {
  const auto axis = [&](Vec3d direction) {
    const Vec3d world = TransformVector(node, direction);
    const double length = Length(world);
    return length > 0 && std::isfinite(length) ? world / length : direction;
  };
  const Vec3d x = axis({1, 0, 0}), y = axis({0, 1, 0}), z = axis({0, 0, -1});
  const Vec3d origin = TransformPoint(node, {0, 0, 0});
  Matrix4 matrix;
  for (size_t row = 0; row < 3; ++row) matrix.m[row] = {x[row], y[row], z[row], origin[row]};
  return matrix;
}

void SetSize(double aspect, const GltfView& view, FilmDescription* film) {
  aspect = std::isfinite(aspect) && aspect > 0 ? std::clamp(aspect, kAspectMin, kAspectMax)
                                               : double{kDefaultWidth} / kDefaultHeight;
  const auto pixels = [](double n) {
    return static_cast<int32_t>(std::clamp(std::round(n), 1.0, double{GltfView::kSizePxMax}));
  };
  film->height_px = view.height_px > 0  ? view.height_px
                    : view.width_px > 0 ? pixels(view.width_px / aspect)
                                        : kDefaultHeight;
  film->width_px = view.width_px > 0 ? view.width_px : pixels(film->height_px * aspect);
}

void SetPerspective(double yfov, CameraDescription* camera, const FilmDescription& film) {
  const double aspect = static_cast<double>(film.width_px) / film.height_px;
  const double x = aspect > 1 ? aspect : 1, y = aspect > 1 ? 1 : 1 / aspect;
  const double window[4] = {-x, x, -y, y};
  std::copy(std::begin(window), std::end(window), camera->screen_window);
  // yfov is the angle of the height; ours is that of the shorter side.
  const double half = std::clamp(0.5 * yfov, 1e-4, 1.5);
  const double shorter = aspect >= 1 ? half : std::atan(std::tan(half) * aspect);
  camera->kind = CameraDescription::Kind::kPerspective;
  camera->fov_degrees = static_cast<float>(2 * shorter * kDegrees);
}

bool SetProjection(const tinygltf::Camera& source, const GltfView& view, const std::string& what,
                   Diagnostics* diagnostics, SceneDescription* scene) {
  if (source.type == "perspective") {
    SetSize(source.perspective.aspectRatio, view, &scene->film);
    if (!(source.perspective.yfov > 0)) {
      diagnostics->Error(kFile, absl::StrCat(what, " has no angle (yfov); export the file again"));
      return false;
    }
    SetPerspective(source.perspective.yfov, &scene->camera, scene->film);
    return true;
  }
  const double x = std::fabs(source.orthographic.xmag), y = std::fabs(source.orthographic.ymag);
  if (source.type != "orthographic" || !(x > 0) || !(y > 0) || !std::isfinite(x + y)) {
    diagnostics->Error(kFile, absl::StrCat(what,
                                           " is neither perspective nor orthographic with "
                                           "sizes (xmag, ymag); export the file again"));
    return false;
  }
  SetSize(x / y, view, &scene->film);
  scene->camera.kind = CameraDescription::Kind::kOrthographic;
  // The height stays where the image has another shape.
  const double width = y * scene->film.width_px / scene->film.height_px;
  const double window[4] = {-width, width, -y, y};
  std::copy(std::begin(window), std::end(window), scene->camera.screen_window);
  return true;
}

// Looks at the whole from the front, a little from the right and from above.
void Frame(const Bounds& bounds, const GltfView& view, Diagnostics* diagnostics,
           SceneDescription* scene) {
  SetSize(0, view, &scene->film);
  SetPerspective(kDefaultFov, &scene->camera, scene->film);
  const Vec3d center = bounds.IsEmpty() ? Vec3d{} : (bounds.lower + bounds.upper) * 0.5;
  const double extent = bounds.IsEmpty() ? 1 : 0.5 * Length(bounds.upper - bounds.lower);
  const double radius = extent > 0 && std::isfinite(extent) ? extent : 1;
  const double half = 0.5 * static_cast<double>(scene->camera.fov_degrees) / kDegrees;
  const Vec3d eye = center + Normalize(Vec3d{0.5, 0.4, 1}) * (kAir * radius / std::sin(half));
  Matrix4 matrix;
  if (LookAtMatrix(eye, center, {0, 1, 0}, &matrix)) {
    // pbrt's x points to the left in a right-handed world.
    for (auto& row : matrix.m) row[0] = -row[0];
    scene->camera.world_from_camera.start = scene->camera.world_from_camera.end = matrix;
  }
  diagnostics->Note(kFile, "has no camera; one that sees the whole scene is used");
}

int CameraNode(const tinygltf::Model& model, const std::vector<int>& shown, const std::string& name,
               Diagnostics* diagnostics) {
  std::vector<std::string> names;
  int first = -1;
  for (const int n : shown) {
    const tinygltf::Node& node = model.nodes[static_cast<size_t>(n)];
    if (!HasIndex(model.cameras, node.camera)) continue;
    const std::string& camera = model.cameras[static_cast<size_t>(node.camera)].name;
    if (!name.empty() && (camera == name || node.name == name)) return n;
    names.insert(names.end(), {camera, node.name});
    if (first < 0) first = n;
  }
  if (!name.empty()) {
    diagnostics->Error(
        kFile, absl::StrCat("there is no camera \"", name, "\"", NearestNameHint(name, names),
                            "; give one of the file's by --camera"));
  }
  return first;
}

// Two cameras beside each other may deviate by this: a fraction of their distance, an angle (rad)
// or a ratio. Exporters write numbers of seven digits.
constexpr double kEyeDeviationMax = 1e-3;

// The place of `right` in the space of the camera `left`; empty where they do not look alike.
std::optional<Vec3d> PlaceBeside(const Matrix4& left, const Matrix4& right) {
  Vec3d place;
  for (size_t axis = 0; axis < 3; ++axis) {
    Vec3d of_left, of_right, away;
    for (size_t row = 0; row < 3; ++row) {
      of_left[row] = left.m[row][axis];
      of_right[row] = right.m[row][axis];
      away[row] = right.m[row][3] - left.m[row][3];
    }
    if (Length(of_left - of_right) > kEyeDeviationMax) return std::nullopt;
    place[axis] = Dot(of_left, away);
  }
  return place;
}

// Moves the camera, which is the left eye's, halfway to the right one; returns their distance.
double JoinEyes(const Matrix4& right_start, const Matrix4& right_end, TransformOverTime* camera) {
  double distance = 0;
  for (auto [left, right] :
       {std::pair{&camera->start, &right_start}, std::pair{&camera->end, &right_end}}) {
    const std::optional<Vec3d> place = PlaceBeside(*left, *right);
    if (!place || !(place->x > 0) || std::hypot(place->y, place->z) > kEyeDeviationMax * place->x ||
        (distance > 0 && std::fabs(place->x - distance) > kEyeDeviationMax * distance)) {
      return 0;
    }
    distance = place->x;
    for (auto& row : left->m) row[3] += 0.5 * distance * row[0];
  }
  return distance;
}

}  // namespace

void Bounds::Add(Vec3d p) {
  for (size_t c = 0; c < 3; ++c) {
    lower[c] = std::min(lower[c], p[c]);
    upper[c] = std::max(upper[c], p[c]);
  }
}

float SetCameraOf(const tinygltf::Model& model, const std::vector<int>& shown, const GltfView& view,
                  const std::vector<Matrix4>& start, const std::vector<Matrix4>& end,
                  const Bounds& bounds, Diagnostics* diagnostics, SceneDescription* scene) {
  scene->camera.location = scene->film.location = kFile;
  const auto node = CameraNode(model, shown, view.camera, diagnostics);
  if (node < 0) {
    if (view.camera.empty()) Frame(bounds, view, diagnostics, scene);
    return 0;
  }
  const auto camera_of = [&](int n) -> const tinygltf::Camera& {
    return model.cameras[static_cast<size_t>(model.nodes[static_cast<size_t>(n)].camera)];
  };
  const tinygltf::Camera& source = camera_of(node);
  const std::string what =
      Named("camera", model.nodes[static_cast<size_t>(node)].camera, source.name);
  if (!SetProjection(source, view, what, diagnostics, scene)) return 0;
  TransformOverTime& place = scene->camera.world_from_camera;
  place.start = WorldFromCamera(start[static_cast<size_t>(node)]);
  place.end = WorldFromCamera(end[static_cast<size_t>(node)]);
  if (view.right_camera.empty()) return 0;
  const auto right = CameraNode(model, shown, view.right_camera, diagnostics);
  if (diagnostics->HasErrors()) return 0;
  const tinygltf::Camera& other = camera_of(right);
  const double angle = source.perspective.yfov;
  const bool is_alike = source.type == "perspective" && other.type == source.type &&
                        std::fabs(other.perspective.yfov - angle) <= kEyeDeviationMax * angle;
  const double distance = is_alike
                              ? JoinEyes(WorldFromCamera(start[static_cast<size_t>(right)]),
                                         WorldFromCamera(end[static_cast<size_t>(right)]), &place)
                              : 0;
  if (!(distance > 0)) {
    diagnostics->Error(
        kFile,
        absl::StrCat(what, " and the camera \"", view.right_camera,
                     "\" are not two eyes: both must be perspective, with the same angle and "
                     "direction, and the second to the right of the first; give one camera, "
                     "and --stereo"));
  }
  return static_cast<float>(distance);
}

}  // namespace sheaf::gltf
