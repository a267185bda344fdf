// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LensSystem: traces rays through the surfaces of a lens, and focuses it. In camera space, in
// millimeters: the film is at z = 0, the lens before it at z > 0, and the scene beyond. Source:
// Kolb, Mitchell and Hanrahan 1995, "A Realistic Camera Model for Computer Graphics"; focusing as
// in pbrt, 3rd ed., sec. 6.4.4; spheres and refraction in the form of Feder 1951, "Optical
// Calculations with Automatic Computing Machinery", J. Opt. Soc. Am. 41(9): by curvature, relative
// to the surface's vertex, so that flat surfaces are not a special case and weakly curved ones keep
// their precision.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "worker/render/camera/aperture_shape.h"

namespace sheaf::render {

// d is unit length.
struct LensRay {
  Vec3d o, d;
};

class LensSystem {
 public:
  // Focuses at the description's distance. Errors: kInvalidArgument: a lens that blocks rays near
  // its axis or does not converge light, or a distance too near to focus at.
  static absl::StatusOr<LensSystem> Make(const LensDescription& description, ApertureMask mask);

  // Returns the transmittance of the stop, and in *ray the ray that leaves the frontmost surface.
  // Returns 0, with *ray unspecified, if the ray is blocked by an aperture, total reflection, a
  // missed surface, or crossing surfaces. Requires: ray->o.z <= rear_z_min_mm(), d.z > 0.
  double TraceFromFilm(LensRay* ray) const { return Trace(ray, Stop::kShaped, nullptr); }
  // Whether the ray passes if the stop's opening is a disk that contains its shape at any rotation.
  // *from_middle: distance from the axis at the stop; unchanged if the ray does not reach it.
  bool MayPass(LensRay* ray, double* from_middle) const {
    return Trace(ray, Stop::kBounded, from_middle) != 0;
  }
  // The opposite directions. Require: d.z < 0, starting before the lens. TraceFromScene ignores the
  // stop's shape.
  double TraceToFilm(LensRay* ray) const { return TraceBack(ray, Stop::kShaped); }
  bool TraceFromScene(LensRay* ray) const { return TraceBack(ray, Stop::kIgnored) != 0; }

  // A point of the frontmost surface, and its unit normal towards the scene.
  struct FrontPoint {
    Vec3d p, n;
  };
  // At these distances from the axis; none outside of the surface's opening.
  std::optional<FrontPoint> FrontAt(Vec2d p_mm) const;
  // The radius of a disk that bounds the frontmost surface's opening.
  double front_radius_mm() const;
  // The factor by which the lens changes etendue from the scene to the film: the squared ratio of
  // the two sides' indices, 1 in air.
  double FilmEtendueFactor() const;

  double rear_z_mm() const { return surfaces_.back().z; }  // At the rear surface's vertex.
  double front_z_mm() const { return surfaces_.front().z; }
  double focal_length_mm() const { return focal_length_mm_; }
  double rear_radius_mm() const { return surfaces_.back().aperture_radius; }
  // Range of the rear surface along the axis.
  double rear_z_min_mm() const;
  double rear_z_max_mm() const;

 private:
  struct Surface {
    double z = 0;          // At the vertex.
    double curvature = 0;  // Above 0: the center lies towards the scene.
    double aperture_radius = 0;
    double eta_scene = 1, eta_film = 1;  // Indices on its two sides.
    bool is_stop = false;
  };
  // Principal point and focal point of the film side, then of the scene side; all as z.
  struct CardinalPoints {
    double principal_film = 0, focal_film = 0, principal_scene = 0, focal_scene = 0;
  };
  // Distance of the edge from the vertex along the axis.
  static double Sag(const Surface& surface);
  static bool Intersect(const Surface& surface, LensRay* ray, Vec3d* n, double* cosine);
  static bool Refract(double eta_ratio, Vec3d n, double cosine, LensRay* ray);
  enum class Stop { kShaped, kBounded, kIgnored };
  double Trace(LensRay* ray, Stop stop, double* from_middle) const;
  double TraceBack(LensRay* ray, Stop stop) const;
  // The transmittance of a stop for a ray that lies on it.
  double TransmissionAt(const Surface& surface, const LensRay& ray, Stop stop) const;
  absl::Status Focus(const LensDescription& description);
  absl::StatusOr<CardinalPoints> FindCardinalPoints(double height_mm) const;

  std::vector<Surface> surfaces_;  // From the scene to the film.
  ApertureMask mask_;
  double focal_length_mm_ = 0;
};

}  // namespace sheaf::render
