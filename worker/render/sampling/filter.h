// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PixelFilter: samples a position in the filter's footprint in proportion to the filter's
// magnitude, so that a sample contributes to one pixel only and tiles need no borders. Source:
// Ernst, Stamminger and Greiner 2006, "Filter Importance Sampling".
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

struct FilterSample {
  Vec2f offset;      // From the pixel's center, in pixels.
  float weight = 1;  // Sign of the filter, times integral of |f| over integral of f.
};

class PixelFilter {
 public:
  // Errors: kInvalidArgument with the filter's location: a radius or sigma that is not positive, or
  // a filter whose integral is not positive.
  static absl::StatusOr<PixelFilter> Make(const SceneDescription& scene);
  FilterSample Sample(Vec2f u) const;
  // The filter at an offset from the pixel's center over its integral, in 1 / pixels^2: the density
  // of the offsets of Sample times their weights. 0 beyond the radius. A box includes its left and
  // upper edges alone, so that boxes of radius 1/2 divide the film.
  double Evaluate(Vec2d offset) const { return EvaluateX(offset.x) * EvaluateY(offset.y); }
  // Its factors of the axes, in 1 / pixels.
  double EvaluateX(double offset) const;
  double EvaluateY(double offset) const;
  // The density of film points at `film` if each pixel of a frame samples one, in 1 / pixels^2.
  // About 1 within the frame, exactly so for boxes of radius 1/2; less near its edges, 0 beyond
  // them.
  double SamplesAt(Vec2d film, int32_t width_px, int32_t height_px) const;
  Vec2d radius_px() const {
    return {static_cast<double>(radius_x_px_), static_cast<double>(radius_y_px_)};
  }

 private:
  // One axis, from the center outwards, as a piecewise linear function on equal intervals.
  struct Table {
    std::vector<float> value;     // At the nodes.
    std::vector<float> cdf;       // CDF of |value| at the nodes, from 0 to 1.
    std::vector<uint16_t> guide;  // First interval to test, by u.
    float weight = 1;             // Integral of |f| over integral of f.
    double inverse_integral =
        1;  // The inverse of f's integral over the whole axis, in units of the radius.
  };
  struct AxisSample {
    float x, weight;
  };
  static AxisSample SampleTable(const Table& table, float u);
  AxisSample SampleAxis(float u) const;
  // The filter of an axis at x radii from the center, over its integral in radii.
  double EvaluateAxis(const Table& table, double x) const;
  // SamplesAt along an axis of size_px pixels, at x.
  double SamplesOnAxis(const Table& table, double radius, double x, int32_t size_px) const;

  FilterDescription::Kind kind_ = FilterDescription::Kind::kBox;
  float radius_x_px_ = 0.5f, radius_y_px_ = 0.5f;
  Table table_x_, table_y_;
};

}  // namespace sheaf::render
