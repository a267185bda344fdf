// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GuidedDirections: directions at a vertex by the learned field, beside those of scattering. A
// camera path takes one of the two at random, so the density of a direction is their mixture, by
// which all techniques weigh it. Source: Vorba et al. 2014, "On-line Learning of Parametric Mixture
// Models for Light Transport Simulation". docs/adr/0065.
#pragma once

#include <cstdint>
#include <type_traits>

#include "worker/render/guiding/learned_fields.h"
#include "worker/render/integrator/context.h"

namespace sheaf::render {

// The probability with which a direction is taken from the field. The rest is a defense: a field
// that is wrong at a vertex costs at most a factor 1 / (1 - kGuidedShare) in variance.
inline constexpr float kGuidedShare = 0.5f;

class GuidedDirections {
 public:
  GuidedDirections() = default;
  // region: null where scattering alone samples directions. lights: what is known of lights there.
  GuidedDirections(const GuidingRegion* region, LightVisibilityRow lights)
      : region_(region), lights_(lights) {}

  bool active() const { return region_ != nullptr; }
  LightVisibilityRow lights() const { return lights_; }
  // The probability with which a direction is taken from scattering.
  float ScatteringShare() const { return active() ? 1 - kGuidedShare : 1; }
  // Whether *u, uniform, takes the direction from the field. Makes *u uniform again.
  bool Selects(float* u) const {
    if (!active()) return false;
    const bool selects = *u < kGuidedShare;
    *u = selects ? *u / kGuidedShare : (*u - kGuidedShare) / (1 - kGuidedShare);
    return selects;
  }
  // Requires: active().
  Vec3f Sample(Vec2f u) const { return region_->Sample(u); }
  // The density of w, which scattering samples with density `scattering`. Per solid angle.
  float Pdf(float scattering, Vec3f w) const {
    if (!active()) return scattering;
    return (1 - kGuidedShare) * scattering + kGuidedShare * region_->Pdf(w);
  }

 private:
  const GuidingRegion* region_ = nullptr;
  LightVisibilityRow lights_;
};

// In variants without guiding.
struct NoGuidedDirections {
  static constexpr float ScatteringShare() { return 1; }
  static float Pdf(float scattering, Vec3f) { return scattering; }
  static LightVisibilityRow lights() { return {}; }
};

template <typename C>
using GuidedDirectionsOf = std::conditional_t<C::kGuided, GuidedDirections, NoGuidedDirections>;

// The directions and lights that the fields know at p. may_guide: false where there is no choice of
// directions.
template <typename C>
GuidedDirectionsOf<C> GuidedDirectionsAt([[maybe_unused]] const Context<C>& c,
                                         [[maybe_unused]] Vec3f p,
                                         [[maybe_unused]] bool may_guide = true) {
  if constexpr (C::kGuided) {
    if (c.guiding.fields != nullptr) {
      const GuidingField& field = c.guiding.fields->directions;
      const uint32_t index = field.RegionIndexAt(p);
      return {may_guide ? field.RegionOrNull(index) : nullptr,
              c.guiding.fields->lights.RowOf(index)};
    }
  }
  return {};
}

// Remembers that a sample of the light was tried from p, if the path is one of a training.
template <typename C>
void NoteLight(const Context<C>& c, Vec3f p, uint32_t light, bool is_visible) {
  if constexpr (C::kGuided) {
    if (c.guiding.training != nullptr) c.guiding.training->NoteLight(p, light, is_visible);
  }
}

// The lights that the fields know at the path's last vertex.
template <typename C>
LightVisibilityRow LightsFromLast(const PathState<C>& path) {
  if constexpr (C::kGuided) return path.guided.lights;
  return {};
}

// Remembers the direction that the path takes at p, if the path is one of a training.
template <typename C>
void NoteDirection(const Context<C>& c, Vec3f p, const PathState<C>& path) {
  if (c.guiding.training == nullptr || path.specular) return;
  c.guiding.training->Note(p, path.ray.d, path.pdf, path.throughput, path.radiance);
}

}  // namespace sheaf::render
