// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LensSystem: rays through the surfaces of a lens, and its focusing. In camera space, millimetres:
// the film lies at z = 0, the lens before it at z > 0, the scene beyond. Source: Kolb, Mitchell and
// Hanrahan 1995, "A Realistic Camera Model for Computer Graphics"; focusing as in pbrt, 3rd ed.,
// sec. 6.4.4; spheres and refraction in the form of Feder 1951, "Optical Calculations with
// Automatic Computing Machinery", J. Opt. Soc. Am. 41(9): by curvature, measured from the surface's
// vertex, so that flat surfaces are no special case and weakly curved ones lose no digits.
#pragma once

#include <cstddef>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "worker/render/camera/aperture_shape.h"

namespace sheaf::render {

// d is of unit length.
struct LensRay {
  Vec3d o, d;
};

class LensSystem {
 public:
  // Focused at the description's distance. Errors: kInvalidArgument: a lens that cannot be seen
  // through near its axis or does not gather light, a distance nearer than it can be focused at.
  static absl::StatusOr<LensSystem> Make(const LensDescription& description, ApertureMask mask);

  // The share of light that passes the stop, and the ray as it leaves the foremost surface; 0 where
  // it is held back (*ray is unspecified then): by an edge, total reflection, a surface missed, or
  // because surfaces cross on its way. Requires: ray->o.z <= rear_z_min_mm(), d.z > 0.
  double TraceFromFilm(LensRay* ray) const { return Trace(ray, Stop::kShaped, nullptr); }
  // Whether it comes through where the stop's opening is a disk that holds its shape, however that
  // is turned. *from_middle: how far from the axis it meets the stop; unchanged where it does not.
  bool MayPass(LensRay* ray, double* from_middle) const {
    return Trace(ray, Stop::kBounded, from_middle) != 0;
  }
  // The other way; the stop's shape does not count. Requires: d.z < 0, from before the lens.
  bool TraceFromScene(LensRay* ray) const;

  double rear_z_mm() const { return surfaces_.back().z; }  // Of the rear surface's vertex.
  double front_z_mm() const { return surfaces_.front().z; }
  double focal_length_mm() const { return focal_length_mm_; }
  double rear_radius_mm() const { return surfaces_.back().aperture_radius; }
  // What the rear surface lies between along the axis.
  double rear_z_min_mm() const;
  double rear_z_max_mm() const;

 private:
  struct Surface {
    double z = 0;          // Of the vertex.
    double curvature = 0;  // Above 0: the centre lies towards the scene.
    double aperture_radius = 0;
    double eta_scene = 1, eta_film = 1;  // On its two sides.
    bool is_stop = false;
  };
  // Film side principal point and focal point, then those of the scene side; all as z.
  struct CardinalPoints {
    double principal_film = 0, focal_film = 0, principal_scene = 0, focal_scene = 0;
  };
  // How far the edge lies from the vertex along the axis.
  static double Sag(const Surface& surface);
  static bool Meet(const Surface& surface, LensRay* ray, Vec3d* n, double* cosine);
  static bool Refract(double eta_ratio, Vec3d n, double cosine, LensRay* ray);
  enum class Stop { kShaped, kBounded, kIgnored };
  double Trace(LensRay* ray, Stop stop, double* from_middle) const;
  absl::Status Focus(const LensDescription& description);
  absl::StatusOr<CardinalPoints> FindCardinalPoints(double height_mm) const;

  std::vector<Surface> surfaces_;  // From the scene to the film.
  ApertureMask mask_;
  double focal_length_mm_ = 0;
};

}  // namespace sheaf::render
