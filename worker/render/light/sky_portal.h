// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SkyPortal: a rectangle through which alone an environment map is seen, as through the window of a
// room: directions are sampled within the rectangle as seen from a point, by the map's luminance.
// In coordinates that are the angles of a direction about the rectangle's two edges, that view is a
// rectangle along the axes wherever the point is, so a table of sums over the map in those
// coordinates samples any view. Source: Bitterli, Novak and Jarosz 2015, "Portal-Masked Environment
// Map Sampling".
//
// The pdf is that of the samples exactly: constant in each cell of the table, in both angles, and
// cut off at the view's edges. A view however small has a sum without cancellation: cells that it
// cuts count by themselves, and only whole ones come as differences of sums.
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
  // corners: of a rectangle, in order around it. Light comes from the side to which the cross
  // product of corner 3 - corner 0 and corner 1 - corner 0 points, and goes to the other.
  // map_size: texels along each side of the map, which say how fine the table should be.
  // luminance: from a unit direction, finite, not negative, with this positive mean over the
  // sphere.
  SkyPortal(const Vec3d (&corners)[4], int map_size, double mean_luminance,
            const std::function<double(Vec3f)>& luminance);

  // A direction through the portal as seen from p. None where p does not lie before it.
  Sample SampleFrom(Vec3f p, Vec2f u) const;
  // The pdf of SampleFrom; positive for directions through the portal and for no others. d: unit.
  float Pdf(Vec3f p, Vec3f d) const;
  uint64_t memory_bytes() const { return VectorBytes(values_, sums_); }

 private:
  // Angles as places in the table, both in [0, cells].
  struct Place {
    double x = 0, y = 0;
  };
  struct View {
    Place lower, upper;
    double sum = 0;  // Of the table's values over it; positive.
  };
  // A range along one side of the table: the cells that hold its ends, and how much of them is in
  // it. Where that is one cell, all is in first_part.
  struct Range {
    size_t first, last;
    double first_part, last_part;
  };

  Range RangeOf(double lower, double upper) const;
  std::optional<View> ViewFrom(Vec3f p) const;
  double ToPlace(double angle) const;
  double ToAngle(double place) const;
  // Of whole cells from x0 and y0 up to but not including x1 and y1; 0 where there is none.
  double SumOfCells(size_t x0, size_t x1, size_t y0, size_t y1) const;
  // Of a column's part, by its width.
  double ColumnSum(size_t x, const Range& y) const;
  double SumOf(const Range& x, const Range& y) const;
  double ValueAt(size_t x, size_t y) const { return values_[y * cells_ + x]; }
  float PdfAt(const View& view, Place place) const;

  Vec3d corner_{};                        // The lowest along both axes.
  Vec3d axis_x_{}, axis_y_{}, axis_z_{};  // Unit; the last one to where light comes from.
  double width_ = 0, height_ = 0;         // Along axis_x_, axis_y_.
  size_t cells_ = 0;                      // Along each side.
  std::vector<float> values_;             // By cell, positive; row-major.
  std::vector<double> sums_;              // Of cells below in x and y: [cells_ + 1]^2.
};

}  // namespace sheaf::render
