// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Comparisons of hits with the ray's start, with its end and with each other, where single
// precision cannot decide: in double, and by the order of surfaces that lie at one place
// (contact.h).
#include <algorithm>
#include <cmath>
#include <optional>

#include "worker/render/accel/embree_door.h"

namespace sheaf::render {
namespace {

// Emitters are triangles, spheres and disks of the world.
bool IsFlat(const SceneGeometry& geometry, PrimitiveId emitter) {
  const GeometryGroup& world = geometry.groups[0];
  return emitter.geometry != world.QuadricsId() ||
         world.quadrics[emitter.primitive].quadric.kind == Quadric::Kind::kDisk;
}

}  // namespace

bool TraceContext::IsAfterStart(const RawHit& hit, float doubt) const {
  if (std::fabs(static_cast<double>(hit.t) - start->t) > static_cast<double>(doubt) + start_doubt) {
    return static_cast<double>(hit.t) > start->t;
  }
  if (hit.id == ray.source) return false;
  const std::optional<Contact> contact = ContactAt(geometry, ray, hit);
  if (!contact) return static_cast<double>(hit.t) > start->t;
  if (!AreOnePlace(*start, *contact, ToDouble(ray.d))) return contact->t > start->t;
  return OrderAlong(*start, *contact, ray) < 0;
}

bool TraceContext::IsBeforeEnd(const RawHit& hit) const {
  nearest.contact = 0;
  if (ray.end == Ray::End::kExact) {
    const std::optional<Contact> contact = ContactAt(geometry, ray, hit);
    return (contact ? contact->t : static_cast<double>(hit.t)) < static_cast<double>(ray.t_max);
  }
  std::optional<PrimitiveId> emitter;
  if (ray.end == Ray::End::kEmitter) emitter = PrimitiveOfEmitter(geometry, ray.end_emitter);
  if (emitter && *emitter == hit.id) {
    // A curved emitter may hide its own point; the distance was rounded to float.
    return !IsFlat(geometry, hit.id) && hit.t < ray.t_max * (1 - Gamma(16));
  }
  const std::optional<Contact> contact = ContactAt(geometry, ray, hit);
  if (!contact) return hit.t < ray.t_max;
  if (emitter) {
    RawHit at_end;
    at_end.t = ray.t_max;
    at_end.id = *emitter;
    const std::optional<Contact> end = ContactAt(geometry, ray, at_end);
    if (end) {
      const Vec3d d = ToDouble(ray.d);
      if (!AreOnePlace(*contact, *end, d)) return contact->t < end->t;
      nearest.contact = static_cast<float>(contact->doubt + end->doubt);
      return OrderAlong(*contact, *end, ray) < 0;
    }
  }
  const double along = std::fabs(Dot(contact->n, ToDouble(ray.d)));
  return (static_cast<double>(ray.t_max) - contact->t) * along > contact->bound;
}

bool TraceContext::IsNearest(const RawHit& hit) const {
  const auto is_nearer = [&] {
    return hit.t < nearest.t || (hit.t == nearest.t && hit.id < nearest.id);
  };
  if (nearest.id == PrimitiveId{}) return IsBeforeEnd(hit);
  const Vec3d d = ToDouble(ray.d);
  const std::optional<Contact> a = ContactAt(geometry, ray, hit),
                               b = ContactAt(geometry, ray, nearest);
  if (a && b && AreOnePlace(*a, *b, d)) {
    nearest.contact = std::max(nearest.contact, static_cast<float>(a->doubt + b->doubt));
    const int order = OrderAlong(*a, *b, ray);
    if (order != 0) return order < 0;
    return a->surface == b->surface ? is_nearer() : hit.id < nearest.id;
  }
  const bool same_shape = a && b && a->surface == b->surface;
  const bool wins = !a || !b || same_shape || a->t == b->t ? is_nearer() : a->t < b->t;
  if (wins) nearest.contact = 0;
  return wins;
}

}  // namespace sheaf::render
