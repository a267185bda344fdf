// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/camera/aperture_shape.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "common/math/elementary.h"
#include "worker/render/color/light_image.h"

namespace sheaf::render {
namespace {

constexpr double kPi = std::numbers::pi;

// Corners with alternating radii, the first one at the angle; closed.
std::vector<Vec2d> Corners(int count, double first_angle, double even_radius, double odd_radius) {
  std::vector<Vec2d> corners;
  for (int i = 0; i < count; ++i) {
    const auto turn = SinCos(first_angle + 2 * kPi * i / count);
    const double radius = i % 2 == 0 ? even_radius : odd_radius;
    corners.push_back({radius * turn.cos, radius * turn.sin});
  }
  corners.push_back(corners[0]);
  return corners;
}

double AreaOf(const std::vector<Vec2d>& closed) {
  double twice = 0;
  for (size_t i = 0; i + 1 < closed.size(); ++i) {
    twice += closed[i].x * closed[i + 1].y - closed[i].y * closed[i + 1].x;
  }
  return 0.5 * std::fabs(twice);
}

}  // namespace

DiskPoint SampleUnitDiskPolar(Vec2f u) {
  const double x = 2 * static_cast<double>(u.x) - 1, y = 2 * static_cast<double>(u.y) - 1;
  if (x == 0 && y == 0) return {0, 0};
  if (std::fabs(x) > std::fabs(y)) return {x, (kPi / 4) * (y / x)};
  return {y, (kPi / 2) - (kPi / 4) * (x / y)};
}

Vec2d SampleUnitDisk(Vec2f u) {
  const DiskPoint p = SampleUnitDiskPolar(u);
  const auto turn = SinCos(p.angle);
  return {p.radius * turn.cos, p.radius * turn.sin};
}

Vec2f UnitSquareOfDisk(Vec2d p) {
  const double radius = std::sqrt(p.x * p.x + p.y * p.y);
  // In units of an eighth of a turn, from -1 to 7: the four triangles of the square follow.
  double eighths = Atan2(p.y, p.x) * (4 / kPi);
  if (eighths < -1) eighths += 8;
  Vec2d square;
  if (eighths < 1) {
    square = {radius, radius * eighths};
  } else if (eighths < 3) {
    square = {radius * (2 - eighths), radius};
  } else if (eighths < 5) {
    square = {-radius, radius * (4 - eighths)};
  } else {
    square = {radius * (eighths - 6), -radius};
  }
  const auto to_unit = [](double x) {
    constexpr float kBelowOne = 0x1.fffffep-1f;
    return std::clamp(static_cast<float>((x + 1) / 2), 0.0f, kBelowOne);
  };
  return {to_unit(square.x), to_unit(square.y)};
}

BladePolygon::BladePolygon(int blade_count, double rotation_degrees)
    : corners_(Corners(blade_count, rotation_degrees * (kPi / 180), 1, 1)) {}

Vec2d BladePolygon::Sample(Vec2f u) const {
  const DiskPoint disk = SampleUnitDiskPolar(u);
  const size_t count = corners_.size() - 1;
  const double turn = disk.angle * (0.5 / kPi) + (disk.radius < 0 ? 0.5 : 0);
  const double sector = (turn - std::floor(turn)) * static_cast<double>(count);
  const size_t i = std::min(static_cast<size_t>(sector), count - 1);
  const double along = sector - static_cast<double>(i);
  const double radius = std::fabs(disk.radius);
  return (corners_[i] * (1 - along) + corners_[i + 1] * along) * radius;
}

absl::StatusOr<ApertureMask> ApertureMask::Make(const SceneDescription& scene, FileSource* files) {
  const LensDescription& lens = scene.camera.lens;
  ApertureMask mask;
  mask.aperture_ = lens.aperture;
  switch (lens.aperture) {
    case Aperture::kDisk:
      return mask;
    case Aperture::kGaussian:
      // The integral of exp(-r^2) - exp(-1) over the unit disk.
      mask.scale_ = kPi / (kPi * (1 - 2 * Exp(-1.0)));
      return mask;
    case Aperture::kSquare:
      mask.scale_ = kPi;  // The square has edge length 1.
      return mask;
    case Aperture::kPentagon:
      mask.polygon_ = Corners(5, -0.5 * kPi, 0.8, 0.8);
      break;
    case Aperture::kStar:
      mask.polygon_ = Corners(10, 0, SinCos(0.4 * kPi).cos / SinCos(0.2 * kPi).cos, 1);
      break;
    case Aperture::kImage: {
      if (files == nullptr) return absl::InvalidArgumentError("no files to read the aperture from");
      const absl::StatusOr<LightImage> image =
          ReadLightImage(scene, scene.camera.location, lens.aperture_file, *files);
      if (!image.ok()) return image.status();
      mask.width_ = image->width;
      mask.height_ = image->height;
      double sum = 0;
      for (int y = image->height - 1; y >= 0; --y) {
        for (int x = 0; x < image->width; ++x) {
          const Rgb& texel = image->texels[static_cast<size_t>(y) * image->width + x];
          const float mean = std::max(0.0f, (texel.r + texel.g + texel.b) / 3);
          mask.texels_.push_back(std::isfinite(mean) ? mean : 0);
          sum += mask.texels_.back();
        }
      }
      if (!(sum > 0)) {
        return absl::InvalidArgumentError(absl::StrCat(FormatLocation(scene, scene.camera.location),
                                                       ": the aperture \"", lens.aperture_file,
                                                       "\" lets no light through: it is black"));
      }
      mask.scale_ = 0.25 * kPi * static_cast<double>(mask.texels_.size()) / sum;
      return mask;
    }
  }
  mask.scale_ = kPi / AreaOf(mask.polygon_);
  return mask;
}

bool ApertureMask::IsInPolygon(Vec2d p) const {
  // Counts crossings of a ray to the right; each edge includes its lower end but not its upper one.
  bool inside = false;
  for (size_t i = 0; i + 1 < polygon_.size(); ++i) {
    const Vec2d a = polygon_[i], b = polygon_[i + 1];
    if ((a.y <= p.y) == (b.y <= p.y)) continue;
    const double side = (b.x - a.x) * (p.y - a.y) - (p.x - a.x) * (b.y - a.y);
    inside ^= (b.y > a.y) ? side > 0 : side < 0;
  }
  return inside;
}

double ApertureMask::LookUp(Vec2d p) const {
  const double x = 0.5 * (p.x + 1) * width_ - 0.5, y = 0.5 * (p.y + 1) * height_ - 0.5;
  if (!(x > -1 && x < width_ && y > -1 && y < height_)) return 0;
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  const auto at = [this](int column, int row) -> double {
    if (column < 0 || row < 0 || column >= width_ || row >= height_) return 0;
    return texels_[static_cast<size_t>(row) * width_ + column];
  };
  const double fx = x - x0, fy = y - y0;
  return (1 - fy) * ((1 - fx) * at(x0, y0) + fx * at(x0 + 1, y0)) +
         fy * ((1 - fx) * at(x0, y0 + 1) + fx * at(x0 + 1, y0 + 1));
}

double ApertureMask::Transmission(Vec2d p) const {
  const double squared = p.x * p.x + p.y * p.y;
  switch (aperture_) {
    case Aperture::kDisk:
      return squared <= 1 ? 1 : 0;
    case Aperture::kGaussian:
      return squared < 1 ? scale_ * (Exp(-squared) - Exp(-1.0)) : 0;
    case Aperture::kSquare:
      return std::max(std::fabs(p.x), std::fabs(p.y)) <= 0.5 ? scale_ : 0;
    case Aperture::kPentagon:
    case Aperture::kStar:
      return IsInPolygon(p) ? scale_ : 0;
    case Aperture::kImage:
      return scale_ * LookUp(p);
  }
  return 0;
}

}  // namespace sheaf::render
