// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ExitPupil: the region of the plane at the rear surface's vertex through which rays from a film
// point pass the lens. Source: pbrt, 3rd ed., sec. 6.4.5. The boxes found by search only guide
// sampling: a small fraction of the samples covers everything visible through the rear aperture,
// which is bounded analytically, and the pdf is that of the mixture. If a box misses some light,
// the result is noisier but not biased.
#pragma once

#include <optional>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/camera/lens_system.h"

namespace sheaf::render {

// Fraction of the samples that cover the whole rear aperture.
inline constexpr double kPupilAreaFraction = 1.0 / 64;

struct PupilSample {
  Vec2d p_mm;              // At z = rear_z_mm().
  double pdf_per_mm2 = 0;  // Measure: area of that plane.
};

class ExitPupil {
 public:
  ExitPupil() = default;
  // For film points up to the radius. Cost: about 10^6 rays through the lens.
  ExitPupil(const LensSystem& lens, double film_radius_max_mm);

  // Requires: the distance of film_mm from the axis is at most film_radius_max_mm.
  PupilSample Sample(Vec2d film_mm, Vec2f u) const;
  double Pdf(Vec2d film_mm, Vec2d p_mm) const;

  // For film points on the x axis, where it is symmetric about that axis. Public for tests.
  struct Box {
    double x0 = 0, x1 = 0, y = 0;  // [x0, x1] x [-y, y].
    double Area() const { return (x1 - x0) * 2 * y; }
    bool Holds(Vec2d p) const { return p.x >= x0 && p.x <= x1 && p.y >= -y && p.y <= y; }
  };
  // At a film radius: the box found by search (none if no ray passed), and the analytic bound.
  std::optional<Box> Found(double film_radius_mm) const;
  const Box& All(double film_radius_mm) const { return ring(film_radius_mm).all; }

 private:
  struct Ring {
    bool found = false;
    Box inner, outer;  // Found by search at the ring's two radii; interpolated between.
    Box all;
    double film_radius_mm = 0;  // The inner radius.
  };
  static Box FoundIn(const Ring& ring, double film_radius_mm, double rings_per_mm);
  const Ring& ring(double film_radius_mm) const;

  double rings_per_mm_ = 0;
  std::vector<Ring> rings_;  // Rings of equal width, from the axis outwards.
};

}  // namespace sheaf::render
