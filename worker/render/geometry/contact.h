// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Contacts: surfaces that lie at one place, within the rounding of their coordinates, such as a
// glass and the table it stands on. Distances along a ray cannot tell which of them comes first, so
// an order in space decides, as if each were displaced by an infinitesimal amount: closed
// boundaries of glass and media inwards, so that a body ends before what it touches begins; the
// faces between them towards the camera, the smaller the farther; lamps towards the side that they
// light. The order does not depend on the ray, on the order of the file or on ids, and a ray in the
// opposite direction meets the same surfaces in the opposite order. Source of the principle:
// Edelsbrunner and Muecke 1990, "Simulation of Simplicity"; docs/adr/0099.
#pragma once

#include <optional>

#include "common/math/vec.h"
#include "worker/render/geometry/raw_hit.h"
#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {

// Bound of the relative rounding of a distance to a plane that is computed in single precision, for
// triangles that are no needles.
inline constexpr float kPlaneRounding = Gamma(32);

// A surface where a ray meets its plane. Space: render.
struct Contact {
  double t = 0;      // In lengths of the ray's direction, computed in double.
  Vec3d n;           // Unit geometric normal, on the surface's front.
  double bound = 0;  // Bound of the distance from the plane that the scene describes.
  double doubt = 0;  // Bound of the error of the plane's distance from a point in the tracer.
  double tilt = 0;   // Bound of the sine of the angle between both.
  double area = 0;   // The area of the whole shape.
  const Surface* surface = nullptr;
  PrimitiveId id;
};

// The contact of a hit of the ray, whose t, u and v may be those of the tracer. For triangles only
// hit.id is used. None for curves, which touch nothing along a plane, and for rays in the plane.
std::optional<Contact> ContactAt(const SceneGeometry& geometry, const Ray& ray, const RawHit& hit);

// The contact of ray.source where the ray leaves it. Requires: ray.contact is positive.
std::optional<Contact> ContactOfSource(const SceneGeometry& geometry, const Ray& ray);

// Whether the coordinates cannot tell the two surfaces apart where a ray along d meets them.
bool AreOnePlace(const Contact& a, const Contact& b, Vec3d d);

// For surfaces at one place: negative if the ray meets a before b, positive if after. 0: the two
// are one surface, or a face that is given twice.
int OrderAlong(const Contact& a, const Contact& b, const Ray& ray);

}  // namespace sheaf::render
