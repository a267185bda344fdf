// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Nested dielectrics: overlapping interiors with priorities. A path counts every shape with a
// priority that contains it; the interior of the highest rank displaces the others. See
// interior_table.h.
#pragma once

#include <cstdint>

#include "worker/render/geometry/surface_point.h"
#include "worker/render/integrator/context.h"

namespace sheaf::render {

enum class BoundaryKind : uint8_t {
  kPlain,     // Bounds no interior with a priority.
  kInterior,  // Between an interior of the surface's rank and one of rank `other`.
  kHidden,    // Absent: another interior is on both sides.
  kBroken,    // Left without having been entered; counted.
};
struct Boundary {
  BoundaryKind kind = BoundaryKind::kPlain;
  uint16_t other = kNoRank;
};

// The boundary that a ray along d meets at the point.
template <typename C>
Boundary BoundaryAt(const Context<C>& c, const SurfacePoint& point, Vec3f d,
                    const MediumState<C>& media) {
  if constexpr (C::kNested) {
    const uint16_t rank = point.surface->rank;
    if (rank == kNoRank) return {};
    MediumSet others = media.interiors;
    if (Dot(d, point.ng) > 0 && !others.Remove(rank)) {
      c.counts.CountBroken(point.surface->shape);
      return {BoundaryKind::kBroken, kNoRank};
    }
    const uint16_t top = TopOf(others);
    if (top != kNoRank && top >= rank) return {BoundaryKind::kHidden, top};
    return {BoundaryKind::kInterior, top};
  }
  return {};
}

// The same for the path's ray. Changes *bsdf to that between the two interiors. kHidden also where
// their indices of refraction are equal.
template <typename C>
BoundaryKind ResolveInterior(const Context<C>& c, const SurfacePoint& point,
                             const PathState<C>& path, BsdfOf<typename C::Color>* bsdf) {
  const Boundary boundary = BoundaryAt(c, point, path.ray.d, path.media);
  if constexpr (C::kNested) {
    if (boundary.kind == BoundaryKind::kInterior &&
        !c.scene.interiors->template SetOutside<typename C::Color>(*point.surface, boundary.other,
                                                                   path.wavelengths, bsdf)) {
      return BoundaryKind::kHidden;
    }
  }
  return boundary.kind;
}

// Whether a shadow ray along d passes because the boundary is hidden.
template <typename C>
bool IsHiddenBoundary(const Context<C>& c, const SurfacePoint& point, Vec3f d,
                      const PathState<C>& path, const MediumState<C>& media) {
  if constexpr (C::kNested) {
    const Boundary boundary = BoundaryAt(c, point, d, media);
    if (boundary.kind == BoundaryKind::kHidden) return true;
    if (boundary.kind != BoundaryKind::kInterior) return false;
    BsdfOf<typename C::Color> bsdf;
    return !c.scene.interiors->template SetOutside<typename C::Color>(
        *point.surface, boundary.other, path.wavelengths, &bsdf);
  }
  return false;
}

// Updates *media for a path that crosses a surface with a rank. False where the nesting is broken.
template <typename C>
bool CrossInterior(const Context<C>& c, const Surface& surface, bool enters,
                   MediumState<C>* media) {
  if constexpr (C::kNested) {
    const uint16_t before = TopOf(media->interiors);
    if (enters ? !media->interiors.Add(surface.rank) : !media->interiors.Remove(surface.rank)) {
      return false;
    }
    const uint16_t after = TopOf(media->interiors);
    if (before == after) return true;
    // The medium outside of all interiors is present only where there is no interior.
    const int32_t outside = surface.media.outside;
    const auto medium_of = [&](uint16_t rank) {
      if (rank != kNoRank) return c.scene.interiors->MediumOf(rank);
      return outside == kNone ? kNone : static_cast<int32_t>(c.scene.media->IndexOf(outside));
    };
    const int32_t left = medium_of(before), entered = medium_of(after);
    return (left == kNone || media->set.Remove(static_cast<uint16_t>(left))) &&
           (entered == kNone || media->set.Add(static_cast<uint16_t>(entered)));
  }
  return true;
}

}  // namespace sheaf::render
