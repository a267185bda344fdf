// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Samplers of directions by the intensity of a light without size: spots, maps, measured luminaires
// and projected images. Each has the pdf of a direction, per solid angle. Space: that of the
// distribution. The distributions must outlive their samplers. Source: choice of a region by its
// share of the power, and of a direction in it, pbrt-v4, sec. 12.2 and 12.6.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/base/vector_bytes.h"
#include "common/math/vec.h"
#include "worker/render/light/intensity_map.h"
#include "worker/render/light/photometric_web.h"
#include "worker/render/light/projected_image.h"
#include "worker/render/sampling/discrete_distribution.h"

namespace sheaf::render {

// A cone that is even within cos_start of its axis and falls off to cos_end as
// 3 t^2 - 2 t^3 does, t from 0 at cos_end to 1 at cos_start.
class SpotDirections {
 public:
  // axis: unit.
  SpotDirections(Vec3f axis, float cos_start, float cos_end)
      : axis_(ToDouble(axis)),
        cos_start_(static_cast<double>(cos_start)),
        cos_end_(static_cast<double>(cos_end)) {}
  // The integral of the falloff over all directions; 0 for a cone too narrow for its cosines.
  double Integral() const;
  // Unit. Requires: Integral() > 0.
  Vec3d Sample(Vec2f u) const;
  // Proportional to the falloff. d: unit.
  double Pdf(Vec3d d) const;

 private:
  Vec3d axis_;
  double cos_start_, cos_end_;
};

// Texels of an intensity map by their factor.
class MapDirections {
 public:
  explicit MapDirections(const IntensityMap& map);
  Vec3d Sample(Vec2f u) const;
  // Proportional to the factor. d: unit.
  double Pdf(Vec3f d) const;
  uint64_t memory_bytes() const { return choice_.size_bytes(); }

 private:
  const IntensityMap* map_;
  DiscreteDistribution choice_;  // Over the texels.
};

// Parts of a luminaire's web, each a few degrees wide, by their mean intensity.
class WebDirections {
 public:
  explicit WebDirections(const PhotometricWeb& web);
  Vec3d Sample(Vec2f u) const;
  // Constant in each part, and positive wherever the web is. d: unit.
  double Pdf(Vec3f d) const;
  uint64_t memory_bytes() const {
    return VectorBytes(vertical_, horizontal_) + choice_.size_bytes();
  }

 private:
  double SolidAngle(size_t vertical, size_t horizontal) const;

  // Edges of the parts in radians: from the nadir, and about the axis over one whole turn.
  std::vector<double> vertical_, horizontal_;
  DiscreteDistribution choice_;  // [vertical][horizontal].
};

// Texels of a projected image by their luminance and approximate solid angle.
class ImageDirections {
 public:
  explicit ImageDirections(const ProjectedImage& image);
  Vec3d Sample(Vec2f u) const;
  // d: need not be unit.
  double Pdf(Vec3f d) const;
  uint64_t memory_bytes() const { return choice_.size_bytes(); }

 private:
  // The area of a texel at z = 1.
  double TexelArea() const;

  const ProjectedImage* image_;
  DiscreteDistribution choice_;  // Over the texels.
};

}  // namespace sheaf::render
