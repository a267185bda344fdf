// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sight: how views see a point of a surface, and which of a path's set do.
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "worker/render/eyes/path_views.h"
#include "worker/render/integrator/context.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {

// How a view sees a point of a surface.
struct Sight {
  Vec3f wi;    // Unit, from the point to the lens.
  Vec2d film;  // The point on the eye's own film, in pixels.
  // Pixels of the film per area of the surface at the point.
  double pixels = 0;
  // The density of the view's first vertices there, per area, if it traces one path a pixel. Both
  // are in the same unit of area, which cancels in all ratios.
  double density = 0;
  // The weight of the view's ray to the point: 1 except through realistic lenses.
  double weight = 1;
};

// The view's sight of the point. None where no path of the view can begin with it, whatever is
// between them.
inline std::optional<Sight> SightOf(const CompiledScene& scene, const PathView& view,
                                    const SurfacePoint& point, Vec3f* p_lens) {
  const std::optional<CameraConnection> seen =
      CameraOf(scene, view.eye).SampleWi(point.p, view.lens, view.time);
  if (!seen) return std::nullopt;
  const double samples =
      scene.filter.SamplesAt(seen->film, FilmWidthOf(scene), scene.settings.height_px);
  Sight sight{seen->wi, seen->film};
  sight.pixels = seen->ray_density * std::fabs(static_cast<double>(Dot(seen->wi, point.ng)));
  sight.density = sight.pixels * samples;
  sight.weight = seen->importance / seen->ray_density;
  *p_lens = seen->p_lens;
  if (!(sight.density > 0) || !std::isfinite(sight.density) || !std::isfinite(sight.weight)) {
    return std::nullopt;
  }
  return sight;
}

// The views that see a point, with nothing between: the path's own first.
struct ViewsOfPoint {
  struct Entry {
    Eye eye = Eye::kLeft;
    Sight sight{};
    Vec3f p_lens{};
  };
  int32_t count = 0;
  std::array<Entry, kPathViewsMax> entries;
  void Add(const Entry& entry) { entries[static_cast<size_t>(count++)] = entry; }
};

// Whether both views see the point from one side, so that its material and the media around it are
// the same for both.
inline bool AreOnOneSide(const SurfacePoint& point, Vec3f a, Vec3f b) {
  return Dot(a, point.ng) * Dot(b, point.ng) > 0;
}

// Whether nothing is between the point and a lens; not even a cut-out, through which a path would
// come with a probability of its own.
template <typename C>
bool IsInView(const Context<C>& c, const SurfacePoint& point, Vec3f wi, Vec3f p_lens, float time) {
  Ray ray;
  ray.time = time;
  Leave(point, wi, &ray);
  ray.d = p_lens - ray.o;
  ray.t_max = 1;
  ray.end = Ray::End::kFree;
  ++c.counts.rays;
  ++c.counts.shadow_rays;
  return !c.tracer.Occluded(ray);
}

// The views of the origin's set that see the point, to which the path came from its own view with
// nothing in between. time: the path's. see(view, is_own, &entry): whether the view counts; it may
// change the entry.
template <typename C, typename See>
void FindViews(const Context<C>& c, const PathSharing& sharing, const PathOrigin& origin,
               const SurfacePoint& point, float time, const See& see, ViewsOfPoint* views) {
  const CompiledScene& scene = c.scene;
  const int32_t shares = SharesAt(scene, sharing, point.p, time);
  if (shares == 1 && scene.eyes == nullptr) return;
  ViewsOfPoint::Entry own{origin.eye};
  const PathView own_view{origin.eye, origin.lens, time};
  const std::optional<Sight> own_sight = SightOf(scene, own_view, point, &own.p_lens);
  if (!own_sight) return;
  own.sight = *own_sight;
  const Vec3f own_wi = own_sight->wi;
  if (!see(own_view, /*is_own=*/true, &own)) return;
  views->Add(own);
  for (int32_t i = 0; i < shares; ++i) {
    for (const Eye eye : {origin.eye, OtherThan(origin.eye)}) {
      if (eye == origin.eye ? i == 0 : scene.eyes == nullptr) continue;
      const PathView view = ViewOf(scene, sharing, origin, eye, shares, i);
      ViewsOfPoint::Entry entry{eye};
      const std::optional<Sight> sight = SightOf(scene, view, point, &entry.p_lens);
      if (!sight || !AreOnOneSide(point, own_wi, sight->wi)) continue;
      entry.sight = *sight;
      if (see(view, /*is_own=*/false, &entry)) views->Add(entry);
    }
  }
}

}  // namespace sheaf::render
