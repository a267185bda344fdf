// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/sky_portal.h"

#include <algorithm>
#include <cmath>

#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

// Bounds of the table, at most 12 MB. Its cells are as small as texels or, for large maps,
// evaluated at several points.
constexpr int kCellsMin = 256, kCellsMax = 1024, kPointsAcrossMax = 4;
// Fraction of the mean luminance that is added everywhere, so that features between a cell's
// evaluation points are sampled too.
constexpr double kPortalLeastPart = 1.0 / 16;

// Angles about the y axis (tangent x / z) and the x axis (tangent y / z), both within pi / 2.
struct Angles {
  SinCosPair<double> x, y;
};

// Returns a unit vector with z >= 0. Avoids tangents, which diverge towards the horizon.
Vec3d DirectionOf(const Angles& a) {
  const double length = std::sqrt(a.y.cos * a.y.cos + a.y.sin * a.y.sin * a.x.cos * a.x.cos);
  return Vec3d{a.x.sin * a.y.cos, a.y.sin * a.x.cos, a.x.cos * a.y.cos} / length;
}
// Solid angle per unit of both angles: the Jacobian of the rectified map, eq. 3 of the paper with
// cosines in place of tangents.
double SolidAnglePerArea(const Angles& a) {
  const double square = a.y.cos * a.y.cos + a.y.sin * a.y.sin * a.x.cos * a.x.cos;
  return a.x.cos * a.y.cos / (square * std::sqrt(square));
}

}  // namespace

SkyPortal::SkyPortal(const Vec3d (&corners)[4], int map_size, double mean_luminance,
                     const std::function<double(Vec3f)>& luminance) {
  const Vec3d along_x = corners[3] - corners[0], along_y = corners[1] - corners[0];
  corner_ = corners[0];
  width_ = Length(along_x);
  height_ = Length(along_y);
  axis_x_ = along_x / width_;
  axis_z_ = Normalize(Cross(along_x, along_y));
  axis_y_ = Cross(axis_z_, axis_x_);
  cells_ = static_cast<size_t>(std::clamp(2 * map_size, kCellsMin, kCellsMax));
  const size_t n = cells_;
  const auto across =
      static_cast<size_t>(std::clamp(2 * map_size / static_cast<int>(cells_), 2, kPointsAcrossMax));
  values_.resize(n * n);
  sums_.assign((n + 1) * (n + 1), 0);
  std::vector<SinCosPair<double>> angles;
  for (size_t i = 0; i < n * across; ++i) {
    angles.push_back(SinCos(ToAngle((static_cast<double>(i) + 0.5) / static_cast<double>(across))));
  }
  for (size_t y = 0; y < n; ++y) {
    double row = 0;
    for (size_t x = 0; x < n; ++x) {
      double squares = 0;
      for (size_t i = 0; i < across * across; ++i) {
        const Angles at{angles[x * across + i % across], angles[y * across + i / across]};
        const Vec3d d = DirectionOf(at);
        const double seen =
            luminance(ToFloat(d.x * axis_x_ + d.y * axis_y_ + d.z * axis_z_)) / mean_luminance;
        const double value = (seen + kPortalLeastPart) * SolidAnglePerArea(at);
        squares += value * value;
      }
      // For a constant pdf, the root mean square gives the least variance.
      values_[y * n + x] = static_cast<float>(std::sqrt(squares));
      row += static_cast<double>(values_[y * n + x]);
      sums_[(y + 1) * (n + 1) + x + 1] = sums_[y * (n + 1) + x + 1] + row;
    }
  }
}

double SkyPortal::ToPlace(double angle) const {
  const double side = static_cast<double>(cells_);
  return std::clamp((angle * (1 / kPi) + 0.5) * side, 0.0, side);
}
double SkyPortal::ToAngle(double place) const {
  return (place / static_cast<double>(cells_) - 0.5) * kPi;
}

SkyPortal::Range SkyPortal::RangeOf(double lower, double upper) const {
  Range range{};
  range.first = std::min(static_cast<size_t>(lower), cells_ - 1);
  range.last = std::min(static_cast<size_t>(upper), cells_ - 1);
  if (range.first == range.last) {
    range.first_part = upper - lower;
  } else {
    range.first_part = static_cast<double>(range.first + 1) - lower;
    range.last_part = upper - static_cast<double>(range.last);
  }
  return range;
}

double SkyPortal::SumOfCells(size_t x0, size_t x1, size_t y0, size_t y1) const {
  if (x0 >= x1 || y0 >= y1) return 0;
  const size_t stride = cells_ + 1;
  return (sums_[y1 * stride + x1] - sums_[y1 * stride + x0]) -
         (sums_[y0 * stride + x1] - sums_[y0 * stride + x0]);
}

double SkyPortal::ColumnSum(size_t x, const Range& y) const {
  return y.first_part * static_cast<double>(ValueAt(x, y.first)) +
         SumOfCells(x, x + 1, y.first + 1, y.last) +
         y.last_part * static_cast<double>(ValueAt(x, y.last));
}

double SkyPortal::SumOf(const Range& x, const Range& y) const {
  double sum = x.first_part * ColumnSum(x.first, y);
  if (x.last > x.first) {
    sum += x.last_part * ColumnSum(x.last, y);
    sum += y.first_part * SumOfCells(x.first + 1, x.last, y.first, y.first + 1) +
           SumOfCells(x.first + 1, x.last, y.first + 1, y.last) +
           y.last_part * SumOfCells(x.first + 1, x.last, y.last, y.last + 1);
  }
  return sum;
}

std::optional<SkyPortal::View> SkyPortal::ViewFrom(Vec3f p) const {
  const Vec3d to_corner = corner_ - ToDouble(p);
  const double x = Dot(to_corner, axis_x_), y = Dot(to_corner, axis_y_);
  const double z = Dot(to_corner, axis_z_);
  if (!(z > 0)) return std::nullopt;
  View view;
  view.lower = {ToPlace(Atan2(x, z)), ToPlace(Atan2(y, z))};
  view.upper = {ToPlace(Atan2(x + width_, z)), ToPlace(Atan2(y + height_, z))};
  if (!(view.lower.x < view.upper.x && view.lower.y < view.upper.y)) return std::nullopt;
  view.sum = SumOf(RangeOf(view.lower.x, view.upper.x), RangeOf(view.lower.y, view.upper.y));
  if (!(view.sum > 0)) return std::nullopt;
  return view;
}

float SkyPortal::PdfAt(const View& view, Place place) const {
  const size_t x = std::min(static_cast<size_t>(place.x), cells_ - 1);
  const size_t y = std::min(static_cast<size_t>(place.y), cells_ - 1);
  const Angles angles{SinCos(ToAngle(place.x)), SinCos(ToAngle(place.y))};
  const double cells_per_angle = static_cast<double>(cells_) / kPi;
  const double solid_angle = SolidAnglePerArea(angles);
  if (!(solid_angle > 0) || !std::isfinite(solid_angle)) return 0;
  return static_cast<float>(static_cast<double>(ValueAt(x, y)) / view.sum * cells_per_angle *
                            cells_per_angle / solid_angle);
}

SkyPortal::View SkyPortal::WholeView() const {
  const auto side = static_cast<double>(cells_);
  return {{0, 0}, {side, side}, SumOf(RangeOf(0, side), RangeOf(0, side))};
}

SkyPortal::Place SkyPortal::PlaceOf(Vec3d d, double z) const {
  return {ToPlace(Atan2(Dot(d, axis_x_), z)), ToPlace(Atan2(Dot(d, axis_y_), z))};
}

Vec3f SkyPortal::DirectionAt(Place place) const {
  const Vec3d d = DirectionOf({SinCos(ToAngle(place.x)), SinCos(ToAngle(place.y))});
  return ToFloat(d.x * axis_x_ + d.y * axis_y_ + d.z * axis_z_);
}

float SkyPortal::Pdf(Vec3f p, Vec3f d) const {
  const Vec3d wide = ToDouble(d);
  const double z = Dot(wide, axis_z_);
  if (!(z > 0)) return 0;
  const std::optional<View> view = ViewFrom(p);
  if (!view) return 0;
  const Place place = PlaceOf(wide, z);
  if (!(place.x >= view->lower.x && place.x <= view->upper.x && place.y >= view->lower.y &&
        place.y <= view->upper.y)) {
    return 0;
  }
  return PdfAt(*view, place);
}

namespace {

// Returns the position in a range where a cumulative sum reaches `wanted`. sum_before: sum of the
// cells before a given one, ascending; density: that cell's sum per length.
template <typename SumBefore, typename Density>
double Invert(size_t first, size_t last, double lower, double upper, double wanted,
              const SumBefore& sum_before, const Density& density) {
  size_t low = first, high = last;
  while (low < high) {
    const size_t middle = (low + high + 1) / 2;
    if (sum_before(middle) <= wanted) {
      low = middle;
    } else {
      high = middle - 1;
    }
  }
  const double begin = std::max(lower, static_cast<double>(low));
  const double end = std::min(upper, static_cast<double>(low + 1));
  return std::clamp(begin + (wanted - (low > first ? sum_before(low) : 0)) / density(low), begin,
                    end);
}

}  // namespace

SkyPortal::Place SkyPortal::SamplePlace(const View& view, Vec2f u) const {
  const Range x = RangeOf(view.lower.x, view.upper.x);
  const Range y = RangeOf(view.lower.y, view.upper.y);
  Place place;
  place.x = Invert(
      x.first, x.last, view.lower.x, view.upper.x, static_cast<double>(u.x) * view.sum,
      [&](size_t column) { return SumOf(RangeOf(view.lower.x, static_cast<double>(column)), y); },
      [&](size_t column) { return ColumnSum(column, y); });
  const size_t column = std::min(static_cast<size_t>(place.x), x.last);
  place.y = Invert(
      y.first, y.last, view.lower.y, view.upper.y, static_cast<double>(u.y) * ColumnSum(column, y),
      [&](size_t row) {
        return ColumnSum(column, RangeOf(view.lower.y, static_cast<double>(row)));
      },
      [&](size_t row) { return static_cast<double>(ValueAt(column, row)); });
  return place;
}

SkyPortal::Sample SkyPortal::SampleFrom(Vec3f p, Vec2f u) const {
  const std::optional<View> view = ViewFrom(p);
  if (!view) return {};
  const Place place = SamplePlace(*view, u);
  return {DirectionAt(place), PdfAt(*view, place)};
}

SkyPortal::RaySample SkyPortal::SampleRay(Vec2f u_direction, Vec2f u_point) const {
  const View view = WholeView();
  const Place place = SamplePlace(view, u_direction);
  RaySample ray;
  ray.d = DirectionAt(place);
  ray.p = corner_ + static_cast<double>(u_point.x) * width_ * axis_x_ +
          static_cast<double>(u_point.y) * height_ * axis_y_;
  const double cosine = Dot(ToDouble(ray.d), axis_z_);
  if (cosine > 0) ray.pdf = static_cast<double>(PdfAt(view, place)) / (Area() * cosine);
  return ray;
}

double SkyPortal::PdfRay(Vec3f p, Vec3f d) const {
  if (!(Pdf(p, d) > 0)) return 0;
  const Vec3d wide = ToDouble(d);
  const double cosine = Dot(wide, axis_z_);
  return static_cast<double>(PdfAt(WholeView(), PlaceOf(wide, cosine))) / (Area() * cosine);
}

double SkyPortal::PdfOfRays(Vec3f d) const {
  const Vec3d wide = ToDouble(d);
  const double cosine = Dot(wide, axis_z_);
  if (!(cosine > 0)) return 0;
  return static_cast<double>(PdfAt(WholeView(), PlaceOf(wide, cosine))) / cosine;
}

}  // namespace sheaf::render
