// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Medium boundaries: the media a path is in at its start, and how they change at the surfaces that
// it crosses. See docs/adr/0018-media-by-counts.md and 0051.
#pragma once

#include <cstdint>
#include <optional>

#include "common/base/check.h"
#include "worker/render/integrator/context.h"
#include "worker/render/integrator/nested_dielectrics.h"
#include "worker/render/integrator/visibility.h"

namespace sheaf::render {

// Combines the media that *media holds now, in its form.
template <typename C>
void UpdateProperties(const Context<C>& c, const PathState<C>& path, MediumState<C>* media) {
  media->properties = c.scene.media->template PropertiesOf<typename C::Color>(
      media->set, path.wavelengths, media->properties.form, media->subsurface_texture.OrNull());
}

// Sets the media at the camera.
template <typename C>
void StartInMedia(const Context<C>& c, PathState<C>* path) {
  if (!c.scene.media) return;
  path->media.set = c.scene.media->camera_media();
  if constexpr (C::kNested) {
    if (c.scene.interiors) {
      path->media.interiors = c.scene.interiors->camera_interiors();
      const uint16_t top = TopOf(path->media.interiors);
      const int32_t medium = top == kNoRank ? kNone : c.scene.interiors->MediumOf(top);
      const MediumSet& declared = path->media.set;
      // The scene may declare a camera inside an interior as in its medium, or in the one outside.
      if (medium != kNone && (declared.empty() || *declared.begin() != medium)) {
        const bool fits = path->media.set.Add(static_cast<uint16_t>(medium));
        SHEAF_CHECK(fits);
      }
    }
  }
  path->media.properties = c.scene.media->template PropertiesOf<typename C::Color>(
      path->media.set, path->wavelengths, MediumForm::kTrue);
}

// Counts a scattering event in *media. After the number of events in the settings, the media take
// their reduced form.
template <typename C>
void CountScattering(const Context<C>& c, const PathState<C>& path, MediumState<C>* media) {
  const auto similar_after = static_cast<uint32_t>(c.scene.settings.similarity_after);
  if (++media->scatterings != similar_after) return;
  media->properties.form = MediumForm::kReduced;
  UpdateProperties(c, path, media);
}

// Applies the media on both sides of the surface, for a path that arrives from one side and
// continues on one of them. False where the path ends; contradictions are counted.
template <typename C>
bool UpdateMedia(const Context<C>& c, const SurfacePoint& point, bool from_front, bool to_front,
                 const PathState<C>& path, MediumState<C>* media) {
  const Surface& surface = *point.surface;
  if (!surface.media.Separates()) return true;
  const auto index_of = [&c](int32_t medium) {
    return medium == kNone ? std::nullopt : std::optional(c.scene.media->IndexOf(medium));
  };
  const MediumSides sides{index_of(surface.media.inside), index_of(surface.media.outside)};
  const Nesting nesting = CrossSides(sides, from_front, to_front, &media->set);
  const bool contradicts = nesting == Nesting::kContradicted;
  if (nesting != Nesting::kRight) c.counts.CountBroken(surface.shape);
  // Subsurface walks rely on having entered through the boundary.
  const bool leaves_subsurface = surface.encloses_subsurface && !from_front;
  if (nesting == Nesting::kFull || (contradicts && leaves_subsurface)) return false;
  if (contradicts || from_front != to_front) UpdateProperties(c, path, media);
  return true;
}

// The plane of the point, at which the path is. By members: a copy of a plane made elsewhere waits
// for the stores that made it.
inline void SetNear(const SurfacePoint& point, Vec3f n, bool is_set, NearPlane* near) {
  near->p = point.p;
  near->n = n;
  near->is_set = is_set;
  near->p_error = 0;
  near->offset = {};
  near->has_offset = true;
}

// Updates *media for a ray along w that leaves the surface on the other side. False where the
// nesting of media is broken, which is counted.
template <typename C>
bool CrossBoundary(const Context<C>& c, const SurfacePoint& point, Vec3f w,
                   const PathState<C>& path, MediumState<C>* media) {
  const bool enters = Dot(w, point.ng) < 0;
  SetNear(point, enters ? -point.ng : point.ng, true, &media->near);
  const Crossing crossing{point.id, point.p, point.p_error, point.ng, enters};
  if (IsSameCrossing(crossing, media->last)) return true;
  media->last = crossing;
  if constexpr (C::kTexturedSubsurface) {
    if (enters && point.surface->encloses_subsurface) {
      media->subsurface_texture = {};
      if (point.surface->has_subsurface_texture) {
        media->subsurface_texture.value = c.scene.materials->SubsurfaceAlbedo(
            point.surface->material, TexturePointOf(c, point), path.wavelengths);
      }
    }
  }
  if constexpr (C::kNested) {
    if (point.surface->rank != kNoRank) {
      if (!CrossInterior(c, *point.surface, enters, media)) {
        c.counts.CountBroken(point.surface->shape);
        return false;
      }
      UpdateProperties(c, path, media);
      return true;
    }
  }
  return UpdateMedia(c, point, enters, !enters, path, media);
}

// As CrossBoundary, for a ray that arrived along path.ray and may stay on its side.
template <typename C>
bool EnterSide(const Context<C>& c, const SurfacePoint& point, Vec3f w, bool is_hair,
               const PathState<C>& path, MediumState<C>* media) {
  const float came_along = Dot(path.ray.d, point.ng), goes_along = Dot(w, point.ng);
  if (!is_hair && came_along * goes_along > 0) return CrossBoundary(c, point, w, path, media);
  const bool in_front = goes_along >= 0;
  SetNear(point, in_front ? point.ng : -point.ng, !is_hair, &media->near);
  if (is_hair || (C::kNested && point.surface->rank != kNoRank)) return true;
  return UpdateMedia(c, point, in_front, in_front, path, media);
}

}  // namespace sheaf::render
