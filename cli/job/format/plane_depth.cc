// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/format/plane_depth.h"

#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "common/film/exr/resumed_image.h"
#include "common/math/transform.h"

namespace sheaf::cli {
namespace {

// A matrix of an image's attributes, whose points are rows.
std::optional<Matrix4> MatrixOf(const FrameImage& image, const char* name) {
  const auto found = image.attributes.find(name);
  if (found == image.attributes.end()) return std::nullopt;
  const std::vector<std::string> items = absl::StrSplit(found->second, ' ');
  if (items.size() != 16) return std::nullopt;
  Matrix4 matrix;
  for (size_t i = 0; i < items.size(); ++i) {
    if (!absl::SimpleAtod(items[i], &matrix.m[i % 4][i / 4])) return std::nullopt;
  }
  return matrix;
}

double Length(double x, double y, double z) { return std::sqrt(x * x + y * y + z * z); }

// Planar distances of an image's pixels from distances along their rays.
class Projection {
 public:
  static std::optional<Projection> Of(const FrameImage& image) {
    const std::optional<Matrix4> camera = MatrixOf(image, "worldToCamera");
    const std::optional<Matrix4> ndc = MatrixOf(image, "worldToNDC");
    if (!camera || !ndc || image.frame_width_px < 1 || image.frame_height_px < 1) {
      return std::nullopt;
    }
    Projection projection;
    // Directions suffice, and keep all digits if the camera is far from the origin.
    Matrix4 axes = *camera, frame = *ndc;
    for (size_t i = 0; i < 3; ++i) axes.m[i][3] = frame.m[i][3] = 0;
    if (!Invert(axes, &projection.world_from_camera_)) return std::nullopt;
    projection.frame_from_camera_ = frame * projection.world_from_camera_;
    projection.is_perspective_ = projection.frame_from_camera_.m[3][2] > 0;
    projection.ahead_length_ = Length(axes.m[2][0], axes.m[2][1], axes.m[2][2]);
    projection.width_px_ = image.frame_width_px;
    projection.height_px_ = image.frame_height_px;
    return projection;
  }

  // The part of a distance along the ray through a pixel's center that is straight ahead.
  double Ahead(int32_t x_px, int32_t y_px) const {
    if (!is_perspective_) return 1;
    const auto& to_frame = frame_from_camera_.m;
    const double w = to_frame[3][2];
    const double x = (w * (x_px + 0.5) / width_px_ - to_frame[0][2]) / to_frame[0][0];
    const double y = (w * (y_px + 0.5) / height_px_ - to_frame[1][2]) / to_frame[1][1];
    double world[3];
    for (size_t i = 0; i < 3; ++i) {
      const auto& row = world_from_camera_.m[i];
      world[i] = row[0] * x + row[1] * y + row[2];
    }
    return 1 / (Length(world[0], world[1], world[2]) * ahead_length_);
  }

 private:
  Matrix4 world_from_camera_, frame_from_camera_;  // For directions.
  bool is_perspective_ = false;
  double ahead_length_ = 1;  // A world unit straight ahead, in the camera's space.
  double width_px_ = 1, height_px_ = 1;
};

}  // namespace

absl::Status MakePlaneDepth(FrameImage* image) {
  std::vector<float>* const depth = image->Find("depth.Z");
  const std::vector<float>* const alpha = image->Find("A");
  const std::optional<Projection> projection = Projection::Of(*image);
  if (depth == nullptr || alpha == nullptr || !projection) {
    return absl::FailedPreconditionError(
        "depth.Z stays the distance along the ray: the camera has no plane, as perspective and "
        "orthographic ones do");
  }
  const PixelRect& window = image->window;
  for (int32_t y = window.y0; y < window.y1; ++y) {
    for (int32_t x = window.x0; x < window.x1; ++x) {
      const auto i = static_cast<size_t>(window.IndexOf(x, y));
      float& value = (*depth)[i];
      value =
          (*alpha)[i] > 0 ? static_cast<float>(value * projection->Ahead(x, y)) : kBackgroundDepth;
    }
  }
  image->metadata[kDepthKey] = kPlaneDepth;
  return absl::OkStatus();
}

}  // namespace sheaf::cli
