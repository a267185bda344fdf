// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SkyPortal: a rectangle through which alone an environment map is visible, such as a window of a
// room. Samples directions through the rectangle as seen from a point, by the map's luminance. In
// coordinates that are the angles of a direction about the rectangle's two edges, that view is an
// axis-aligned rectangle from every point, so a summed-area table of the map in those coordinates
// samples any view. Source: Bitterli, Novak and Jarosz 2015, "Portal-Masked Environment Map
// Sampling".
//
// The pdf matches the samples exactly: constant in each cell of the table, in both angles, and cut
// off at the view's edges. Even a tiny view has a sum without cancellation: cells that its edges
// cut are added individually, and only whole cells come from differences of sums.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "common/base/vector_bytes.h"
#include "common/math/vec.h"

namespace sheaf::render {

class SkyPortal {
 public:
  // d: unit; pdf: solid angle, 0 where there is no sample.
  struct Sample {
    Vec3f d;
    float pdf = 0;
  };
  // corners: of a rectangle, in order around it. Light arrives from the side to which the cross
  // product of corner 3 - corner 0 and corner 1 - corner 0 points. map_size: texels along each side
  // of the map, which set the table's resolution. luminance: of a unit direction, finite,
  // nonnegative, with this positive mean over the sphere.
  SkyPortal(const Vec3d (&corners)[4], int map_size, double mean_luminance,
            const std::function<double(Vec3f)>& luminance);

  // Samples a direction through the portal as seen from p. pdf 0 where p is not in front of it.
  Sample SampleFrom(Vec3f p, Vec2f u) const;
  // The pdf of SampleFrom; positive exactly for directions through the portal. d: unit.
  float Pdf(Vec3f p, Vec3f d) const;
  uint64_t memory_bytes() const { return VectorBytes(values_, sums_); }

  // --- For rays that enter through the portal, wherever they lead

  // p: on the rectangle. d: unit, against the ray. pdf: solid angle times area perpendicular to the
  // ray; 0 where there is no sample.
  struct RaySample {
    Vec3d p;
    Vec3f d;
    double pdf = 0;
  };
  // Samples the direction by the map's luminance, and the point uniformly.
  RaySample SampleRay(Vec2f u_direction, Vec2f u_point) const;
  // The pdf of SampleRay for the ray that arrives at p from direction d; positive exactly where
  // Pdf(p, d) is. d: unit.
  double PdfRay(Vec3f p, Vec3f d) const;
  // The pdf of the directions of SampleRay, over their cosine with the axis; 0 behind the
  // rectangle.
  double PdfOfRays(Vec3f d) const;
  double Area() const { return width_ * height_; }
  // The axis of the rectangle to which light comes from, and the point at (s, t) of [0, 1]^2.
  Vec3d Axis() const { return axis_z_; }
  Vec3d AxisX() const { return axis_x_; }
  Vec3d PointAt(Vec2d st) const {
    return corner_ + st.x * width_ * axis_x_ + st.y * height_ * axis_y_;
  }
  // (s, t) where the line through p along d meets the plane of the rectangle. Requires: d is not
  // parallel to it.
  Vec2d Meets(Vec3d p, Vec3d d) const {
    const Vec3d q = p + (Dot(corner_ - p, axis_z_) / Dot(d, axis_z_)) * d - corner_;
    return {Dot(q, axis_x_) / width_, Dot(q, axis_y_) / height_};
  }

 private:
  // Angles as a position in the table, both in [0, cells].
  struct Place {
    double x = 0, y = 0;
  };
  struct View {
    Place lower, upper;
    double sum = 0;  // Sum of the table's values over the view; positive.
  };
  // A range along one side of the table: the cells of its ends, and the covered fraction of each.
  // If both are the same cell, first_part holds it all.
  struct Range {
    size_t first, last;
    double first_part, last_part;
  };

  Range RangeOf(double lower, double upper) const;
  std::optional<View> ViewFrom(Vec3f p) const;
  // All directions in front of the rectangle.
  View WholeView() const;
  Place SamplePlace(const View& view, Vec2f u) const;
  // z: the component of d along axis_z_, positive.
  Place PlaceOf(Vec3d d, double z) const;
  // Unit.
  Vec3f DirectionAt(Place place) const;
  double ToPlace(double angle) const;
  double ToAngle(double place) const;
  // Sum of whole cells in [x0, x1) x [y0, y1); 0 if empty.
  double SumOfCells(size_t x0, size_t x1, size_t y0, size_t y1) const;
  // Sum of a part of a column, per unit width.
  double ColumnSum(size_t x, const Range& y) const;
  double SumOf(const Range& x, const Range& y) const;
  double ValueAt(size_t x, size_t y) const { return values_[y * cells_ + x]; }
  float PdfAt(const View& view, Place place) const;

  Vec3d corner_{};                        // The lower corner along both axes.
  Vec3d axis_x_{}, axis_y_{}, axis_z_{};  // Unit; axis_z_ points to where light comes from.
  double width_ = 0, height_ = 0;         // Along axis_x_, axis_y_.
  size_t cells_ = 0;                      // Along each side.
  std::vector<float> values_;             // By cell, positive; row-major.
  std::vector<double> sums_;              // Sums of cells below in x and y: [cells_ + 1]^2.
};

}  // namespace sheaf::render
