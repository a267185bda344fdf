// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/camera/lens_system.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

namespace sheaf::render {

absl::StatusOr<LensSystem> LensSystem::Make(const LensDescription& description, ApertureMask mask) {
  if (description.surfaces.empty()) return absl::InvalidArgumentError("the lens has no surfaces");
  LensSystem lens;
  lens.mask_ = std::move(mask);
  double z = 0;
  for (size_t i = description.surfaces.size(); i-- > 0;) {
    const LensSurface& given = description.surfaces[i];
    z += given.thickness_mm;
    Surface surface;
    surface.z = z;
    surface.is_stop = IsStop(description, i);
    if (given.curvature_radius_mm != 0) surface.curvature = -1 / given.curvature_radius_mm;
    surface.aperture_radius = 0.5 * given.aperture_diameter_mm;
    if (surface.is_stop) {
      surface.aperture_radius = std::min(
          surface.aperture_radius, 0.5 * static_cast<double>(description.aperture_diameter_mm));
    }
    surface.eta_scene = EtaBefore(description, i);
    surface.eta_film = given.eta;
    lens.surfaces_.push_back(surface);
  }
  std::reverse(lens.surfaces_.begin(), lens.surfaces_.end());
  if (absl::Status status = lens.Focus(description); !status.ok()) return status;
  return lens;
}

// Moves the ray to the surface. n: unit, towards the scene at the vertex; cosine: of the ray with
// n. Returns false if the ray misses, the surface lies behind it, or its aperture blocks it.
bool LensSystem::Intersect(const Surface& surface, LensRay* ray, Vec3d* n, double* cosine) {
  const Vec3d from{ray->o.x, ray->o.y, ray->o.z - surface.z};
  const Vec3d d = ray->d;
  // The ray's point nearest to the vertex; the surface is c |p|^2 = 2 p.z.
  const double to_nearest = -Dot(from, d);
  const Vec3d nearest = from + d * to_nearest;
  const double c = surface.curvature;
  const double beyond = c * Dot(nearest, nearest) - 2 * nearest.z;
  const double squared = d.z * d.z - c * beyond;
  if (!(squared > 0)) return false;
  *cosine = std::copysign(std::sqrt(squared), d.z);
  const double distance = to_nearest + beyond / (d.z + *cosine);
  if (!(distance >= 0)) return false;
  const Vec3d p = from + d * distance;
  const double radius = surface.aperture_radius;
  if (!surface.is_stop && !(p.x * p.x + p.y * p.y <= radius * radius)) return false;
  *n = {-c * p.x, -c * p.y, 1 - c * p.z};
  if (!(n->z > 0)) return false;  // The far half of the sphere is not part of the surface.
  ray->o = {p.x, p.y, p.z + surface.z};
  return true;
}

// eta_ratio: index of the incident side over that of the other side.
bool LensSystem::Refract(double eta_ratio, Vec3d n, double cosine, LensRay* ray) {
  const double squared = 1 - eta_ratio * eta_ratio * (1 - cosine * cosine);
  if (!(squared > 0)) return false;
  const double refracted = std::copysign(std::sqrt(squared), cosine);
  const double forward = ray->d.z;
  ray->d = ray->d * eta_ratio + n * (refracted - eta_ratio * cosine);
  return ray->d.z * forward > 0;  // Rays that turn back are lost in the barrel.
}

double LensSystem::TransmissionAt(const Surface& surface, const LensRay& ray, Stop stop) const {
  if (stop == Stop::kIgnored) return 1;
  const double scale = 1 / surface.aperture_radius;
  const Vec2d p{ray.o.x * scale, ray.o.y * scale};
  if (stop == Stop::kShaped) return mask_.Transmission(p);
  return p.x * p.x + p.y * p.y <= mask_.BoundingRadiusSquared() ? 1 : 0;
}

double LensSystem::Trace(LensRay* ray, Stop stop, double* from_middle) const {
  double weight = 1;
  for (size_t i = surfaces_.size(); i-- > 0;) {
    const Surface& surface = surfaces_[i];
    Vec3d n;
    double cosine = 0;
    if (!Intersect(surface, ray, &n, &cosine)) return 0;
    if (surface.is_stop) {
      if (from_middle != nullptr) {
        *from_middle = std::sqrt(ray->o.x * ray->o.x + ray->o.y * ray->o.y);
      }
      weight *= TransmissionAt(surface, *ray, stop);
      if (weight == 0) return 0;
      continue;
    }
    if (!Refract(surface.eta_film / surface.eta_scene, n, cosine, ray)) return 0;
  }
  return weight;
}

double LensSystem::TraceBack(LensRay* ray, Stop stop) const {
  double weight = 1;
  for (const Surface& surface : surfaces_) {
    Vec3d n;
    double cosine = 0;
    if (!Intersect(surface, ray, &n, &cosine)) return 0;
    if (surface.is_stop) {
      weight *= TransmissionAt(surface, *ray, stop);
      if (weight == 0) return 0;
      continue;
    }
    if (!Refract(surface.eta_scene / surface.eta_film, n, cosine, ray)) return 0;
  }
  return weight;
}

std::optional<LensSystem::FrontPoint> LensSystem::FrontAt(Vec2d p_mm) const {
  const Surface& front = surfaces_.front();
  const double square = p_mm.x * p_mm.x + p_mm.y * p_mm.y, c = front.curvature;
  const double radius = front_radius_mm();
  const double under_root = 1 - c * c * square;
  if (!(square <= radius * radius && under_root > 0)) return std::nullopt;
  const double height = c * square / (1 + std::sqrt(under_root));
  return FrontPoint{{p_mm.x, p_mm.y, front.z + height}, {-c * p_mm.x, -c * p_mm.y, 1 - c * height}};
}

double LensSystem::front_radius_mm() const {
  const Surface& front = surfaces_.front();
  return front.aperture_radius * (front.is_stop ? std::sqrt(mask_.BoundingRadiusSquared()) : 1);
}

double LensSystem::FilmEtendueFactor() const {
  const double ratio = surfaces_.front().eta_scene / surfaces_.back().eta_film;
  return ratio * ratio;
}

absl::StatusOr<LensSystem::CardinalPoints> LensSystem::FindCardinalPoints(double height_mm) const {
  // A ray parallel to the axis, bent once at the principal plane, passes through the focal point.
  const auto cross = [height_mm](const LensRay& out, double* principal, double* focal) {
    *focal = out.o.z - out.o.x / out.d.x * out.d.z;
    *principal = out.o.z + (height_mm - out.o.x) / out.d.x * out.d.z;
  };
  const Surface& front = surfaces_.front();
  LensRay to_film{{height_mm, 0, front.z + std::fabs(Sag(front)) + height_mm}, {0, 0, -1}};
  LensRay to_scene{{height_mm, 0, rear_z_min_mm() - height_mm}, {0, 0, 1}};
  if (!TraceFromScene(&to_film) || Trace(&to_scene, Stop::kIgnored, nullptr) == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("no light passes through the lens ", height_mm,
                     " mm off its axis; its surfaces cross, or an aperture is smaller than that"));
  }
  CardinalPoints points;
  cross(to_film, &points.principal_film, &points.focal_film);
  cross(to_scene, &points.principal_scene, &points.focal_scene);
  return points;
}

absl::Status LensSystem::Focus(const LensDescription& description) {
  // Close enough to the axis for the paraxial points; as in pbrt-v4.
  const double height_mm = 0.001 * static_cast<double>(description.film_diagonal_mm);
  const absl::StatusOr<CardinalPoints> points = FindCardinalPoints(height_mm);
  if (!points.ok()) return points.status();
  focal_length_mm_ = points->principal_film - points->focal_film;
  if (!std::isfinite(focal_length_mm_) || !(focal_length_mm_ > 0)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the lens does not gather light: its focal length is ", focal_length_mm_, " mm"));
  }
  // With the film at distance s' behind one principal plane and the focused object at s before the
  // other, 1/s + 1/s' = 1/f and s + s' is fixed. Takes the smaller root, in the form that keeps its
  // precision for distant objects.
  const double between = points->principal_scene - points->principal_film;
  const double sum_mm = 1000 * static_cast<double>(description.focus_distance_m) - between;
  const double ratio = 4 * focal_length_mm_ / sum_mm;
  if (!(sum_mm > 0 && ratio <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"float focusdistance\" ", description.focus_distance_m,
                     " m is nearer than this lens can be focused at, ",
                     0.001 * (4 * focal_length_mm_ + between), " m from the film"));
  }
  const double film_distance = 2 * focal_length_mm_ / (1 + std::sqrt(1 - ratio));
  const double shift = film_distance - points->principal_film;
  for (Surface& surface : surfaces_) surface.z += shift;
  if (!(rear_z_min_mm() > 0)) {
    return absl::InvalidArgumentError(
        "focused at its distance, the lens touches the film; its last surface is too wide or its "
        "image too near");
  }
  return absl::OkStatus();
}

double LensSystem::rear_z_min_mm() const {
  const Surface& rear = surfaces_.back();
  return rear.z + std::min(0.0, Sag(rear));
}
double LensSystem::rear_z_max_mm() const {
  const Surface& rear = surfaces_.back();
  return rear.z + std::max(0.0, Sag(rear));
}

double LensSystem::Sag(const Surface& surface) {
  const double c = surface.curvature, edge = surface.aperture_radius * surface.aperture_radius;
  const double squared = 1 - c * c * edge;
  // An aperture wider than the sphere ends at its hemisphere.
  return squared > 0 ? c * edge / (1 + std::sqrt(squared)) : 1 / c;
}

}  // namespace sheaf::render
