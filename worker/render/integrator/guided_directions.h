// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GuidedDirections: directions at a vertex by the learned field, beside those of scattering. A
// camera path takes one of the two at random, so the density of a direction is their mixture, by
// which all techniques weigh it. Source: Vorba et al. 2014, "On-line Learning of Parametric Mixture
// Models for Light Transport Simulation". docs/adr/0065.
#pragma once

#include <algorithm>
#include <cstdint>
#include <type_traits>

#include "worker/render/guiding/learned_fields.h"
#include "worker/render/integrator/context.h"

namespace sheaf::render {

class GuidedDirections {
 public:
  GuidedDirections() = default;
  // region: null where scattering alone samples directions. lights: what is known of lights there.
  // split_factor: ContributionField::RegionFactor.
  GuidedDirections(const GuidingRegion* region, LightVisibilityRow lights, float split_factor)
      : region_(region),
        share_(region != nullptr ? region->share() : 0),
        split_factor_(split_factor),
        lights_(lights) {}

  bool active() const { return region_ != nullptr; }
  LightVisibilityRow lights() const { return lights_; }
  // A factor of the number of paths that continue: path_splits.h.
  float split_factor() const { return split_factor_; }
  // GuidingRegion::ScatteredLight; 0 where scattering alone samples directions.
  float ScatteredLight() const {
    return active() ? static_cast<float>(region_->ScatteredLight()) : 0;
  }
  // The probability with which a direction is taken from scattering.
  float ScatteringShare() const { return 1 - share_; }
  // The part that scattering has of a density that is `scale` times as large (0: scattering has
  // none).
  float ScatteringPart(float scale) const { return scale > 0 ? ScatteringShare() / scale : 0; }
  // Whether *u, uniform, takes the direction from the field. Makes *u uniform again.
  bool Selects(float* u) const {
    if (!active()) return false;
    const bool selects = *u < share_;
    *u = std::min(kBelowOneFloat, selects ? *u / share_ : (*u - share_) / (1 - share_));
    return selects;
  }
  // Requires: active().
  Vec3f Sample(Vec2f u) const { return region_->Sample(u); }
  // The density of w, which scattering samples with density `scattering`. Per solid angle.
  float Pdf(float scattering, Vec3f w) const {
    if (!active()) return scattering;
    return (1 - share_) * scattering + share_ * region_->Pdf(w);
  }

 private:
  static constexpr float kBelowOneFloat = 1 - 0x1p-24f;

  const GuidingRegion* region_ = nullptr;
  float share_ = 0, split_factor_ = 0;
  LightVisibilityRow lights_;
};

// In variants that know lights alone.
class KnownLights {
 public:
  KnownLights() = default;
  explicit KnownLights(LightVisibilityRow lights) : lights_(lights) {}
  static constexpr float ScatteringShare() { return 1; }
  static float Pdf(float scattering, Vec3f) { return scattering; }
  LightVisibilityRow lights() const { return lights_; }

 private:
  LightVisibilityRow lights_;
};

// In variants without guiding and learned lights.
struct NoGuidedDirections {
  static constexpr float ScatteringShare() { return 1; }
  static float Pdf(float scattering, Vec3f) { return scattering; }
  static LightVisibilityRow lights() { return {}; }
};

template <typename C>
using GuidedDirectionsOf =
    std::conditional_t<C::kGuided, GuidedDirections,
                       std::conditional_t<C::kKnowsLights, KnownLights, NoGuidedDirections>>;

// The directions and lights that the fields know there. may_guide: false where there is no choice
// of directions.
template <typename C>
GuidedDirectionsOf<C> GuidedDirectionsAt([[maybe_unused]] const Context<C>& c,
                                         [[maybe_unused]] const GuidingPoint& at,
                                         [[maybe_unused]] bool may_guide = true) {
  if constexpr (C::kGuided) {
    if (c.guiding.fields != nullptr) {
      const GuidingField& field = c.guiding.fields->directions;
      const uint32_t index = field.RegionIndexAt(at);
      return {may_guide ? field.RegionOrNull(index) : nullptr,
              c.guiding.fields->lights.RowOf(index),
              may_guide ? c.guiding.fields->contributions.RegionFactor(index) : 0};
    }
  } else if constexpr (C::kKnowsLights) {
    if (c.guiding.fields != nullptr) {
      const LearnedFields& fields = *c.guiding.fields;
      return KnownLights(fields.lights.RowOf(fields.directions.RegionIndexAt(at)));
    }
  }
  return {};
}

// Remembers that a sample of the light was tried from there, if the path is one of a training.
// f_cos: what the vertex scatters of its light.
template <typename C>
void NoteLight([[maybe_unused]] const Context<C>& c, [[maybe_unused]] const GuidingPoint& from,
               [[maybe_unused]] const LightSampleOf<typename C::Color>& light,
               [[maybe_unused]] bool is_visible, [[maybe_unused]] const typename C::Color& f_cos) {
  if constexpr (C::kKnowsLights) {
    if (c.guiding.training == nullptr) return;
    const double contribution =
        MeanRadiance(f_cos * light.radiance) / static_cast<double>(light.pdf);
    c.guiding.training->NoteLight({from, light.light, is_visible, is_visible ? contribution : 0});
  }
}

// The lights that the fields know at the path's last vertex.
template <typename C>
LightVisibilityRow LightsFromLast(const PathState<C>& path) {
  if constexpr (C::kKnowsLights) return path.known.lights;
  return {};
}
// Lets the path remember the lights that are known where it is now.
template <typename C>
void RememberLights([[maybe_unused]] const GuidedDirectionsOf<C>& known,
                    [[maybe_unused]] PathState<C>* path) {
  if constexpr (C::kKnowsLights) path->known.lights = known.lights();
}

// Before the vertex scatters the path, in a direction whose density is that of scattering times
// density_scale.
template <typename C>
void NoteGuiding(const GuidedDirections& guided, float density_scale, PathState<C>* path) {
  GuidedState<typename C::Color>& state = path->guided;
  state.throughput_before = path->throughput;
  state.scattering_part = guided.ScatteringPart(density_scale);
  const float light = MaxComponent(path->throughput) * guided.ScatteredLight();
  if (!(state.first_light > 0)) state.first_light = light;
  state.expected_light = light > 0 ? light / state.first_light : 0;
}

// Remembers the direction that the path takes there, before roulette, if the path is one of a
// training.
template <typename C, typename Vertex>
void NoteDirection(const Context<C>& c, const Vertex& vertex, const PathState<C>& path) {
  if (c.guiding.training == nullptr || (path.specular && !vertex.guided.active())) return;
  c.guiding.training->Note({{vertex.point.p, vertex.light_hint},
                            path.ray.d,
                            path.pdf,
                            vertex.guided.active() ? path.guided.scattering_part : -1,
                            path.specular,
                            path.guided.throughput_before,
                            path.throughput,
                            path.radiance,
                            c.counts.rays});
}

}  // namespace sheaf::render
