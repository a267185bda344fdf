// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer, the part in matter that overlaps: which boundaries are there, and what lies on either
// side of them. Included by path_tracer.h. A path counts every shape with a priority that it is
// inside of; of all their matter that of the highest rank is there. See interior_table.h.
#pragma once

#include "worker/render/integrator/path_tracer.h"

namespace sheaf::render {

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::Boundary
PathTracer<kTraits, Tracer, kDirectLight>::BoundaryAt(const SurfacePoint& point, Vec3f d,
                                                      const InMedia& media) const {
  if constexpr (kNested) {
    const uint16_t rank = point.surface->rank;
    if (rank == kNoRank) return {};
    MediumSet others = media.interiors;
    if (Dot(d, point.ng) > 0 && !others.Remove(rank)) {
      counts_.CountBroken(point.surface->shape);
      return {BoundaryKind::kBroken, kNoRank};
    }
    const uint16_t top = TopOf(others);
    if (top != kNoRank && top >= rank) return {BoundaryKind::kHidden, top};
    return {BoundaryKind::kMatter, top};
  }
  return {};
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::BoundaryKind
PathTracer<kTraits, Tracer, kDirectLight>::MeetInterior(const SurfacePoint& point, const Path& path,
                                                        BsdfOf<Color>* bsdf) const {
  const Boundary boundary = BoundaryAt(point, path.ray.d, path.media);
  if constexpr (kNested) {
    if (boundary.kind == BoundaryKind::kMatter &&
        !scene_.interiors->template SetOutside<Color>(*point.surface, boundary.other,
                                                      path.wavelengths, bsdf)) {
      return BoundaryKind::kHidden;
    }
  }
  return boundary.kind;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::LetsPassByPriority(const SurfacePoint& point,
                                                                   Vec3f d, const Path& path,
                                                                   const InMedia& media) const {
  if constexpr (kNested) {
    const Boundary boundary = BoundaryAt(point, d, media);
    if (boundary.kind == BoundaryKind::kHidden) return true;
    if (boundary.kind != BoundaryKind::kMatter) return false;
    BsdfOf<Color> bsdf;
    return !scene_.interiors->template SetOutside<Color>(*point.surface, boundary.other,
                                                         path.wavelengths, &bsdf);
  }
  return false;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::CrossInterior(const Surface& surface, bool enters,
                                                              InMedia* media) const {
  if constexpr (kNested) {
    const uint16_t before = TopOf(media->interiors);
    if (enters ? !media->interiors.Add(surface.rank) : !media->interiors.Remove(surface.rank)) {
      return false;
    }
    const uint16_t after = TopOf(media->interiors);
    if (before == after) return true;
    // What is outside of all matter is only there where none is.
    const int32_t outside = surface.media.outside;
    const auto medium_of = [&](uint16_t rank) {
      if (rank != kNoRank) return scene_.interiors->MediumOf(rank);
      return outside == kNone ? kNone : static_cast<int32_t>(scene_.media->IndexOf(outside));
    };
    const int32_t left = medium_of(before), entered = medium_of(after);
    return (left == kNone || media->set.Remove(static_cast<uint16_t>(left))) &&
           (entered == kNone || media->set.Add(static_cast<uint16_t>(entered)));
  }
  return true;
}

}  // namespace sheaf::render
