// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ExitPupil: where, in the plane at the rear surface's vertex, the rays of a film point pass that
// come through the lens. Source: pbrt, 3rd ed., sec. 6.4.5. The boxes found by searching steer the
// samples and decide nothing: a small share of them goes to all that the rear surface's edge, seen
// from the film, leaves, which is bounded by arithmetic, and the pdf is that of both. Light that a
// box lacks is therefore never lost, only noisier.
#pragma once

#include <optional>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/camera/lens_system.h"

namespace sheaf::render {

// Of those samples that may go anywhere.
inline constexpr double kPupilShareOfAll = 1.0 / 64;

struct PupilSample {
  Vec2d p_mm;              // At z = rear_z_mm().
  double pdf_per_mm2 = 0;  // Measure: area of that plane.
};

class ExitPupil {
 public:
  ExitPupil() = default;
  // Of film points up to the radius.
  // Cost: some 10^6 rays through the lens.
  ExitPupil(const LensSystem& lens, double film_radius_max_mm);

  // Requires: film_mm is not farther than film_radius_max_mm from the axis.
  PupilSample Sample(Vec2d film_mm, Vec2f u) const;
  double Pdf(Vec2d film_mm, Vec2d p_mm) const;

  // For film points on the x axis; symmetric about it. Public for tests.
  struct Box {
    double x0 = 0, x1 = 0, y = 0;  // [x0, x1] x [-y, y].
    double Area() const { return (x1 - x0) * 2 * y; }
    bool Holds(Vec2d p) const { return p.x >= x0 && p.x <= x1 && p.y >= -y && p.y <= y; }
  };
  // Of a film radius: what was found (none where no ray came through), and what bounds everything.
  std::optional<Box> Found(double film_radius_mm) const;
  const Box& All(double film_radius_mm) const { return ring(film_radius_mm).all; }

 private:
  struct Ring {
    bool found = false;
    Box inner, outer;  // What was found, at the ring's two radii; in between, in between.
    Box all;
    double film_radius_mm = 0;  // The inner one.
  };
  static Box FoundIn(const Ring& ring, double film_radius_mm, double rings_per_mm);
  const Ring& ring(double film_radius_mm) const;

  double rings_per_mm_ = 0;
  std::vector<Ring> rings_;  // Of equal widths, from the axis outwards.
};

}  // namespace sheaf::render
