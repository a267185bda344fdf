// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SpecularSample: the sample of a smooth lobe that continues a path in a given direction.
#pragma once

#include <cstdint>
#include <optional>

#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/integrator/surface_vertex.h"

namespace sheaf::render {

// The sample of a smooth lobe that leads towards w.
template <TraitBits kTraits, typename C>
std::optional<BsdfSampleOf<typename C::Color>> SpecularSample(const SurfaceVertex<C>& at, Vec3f w) {
  const auto sample_by = [&](float u_lobe) {
    if constexpr (C::kPerturbedNormals) {
      if (at.perturbed_normal.active()) {
        return at.perturbed_normal.template Sample<kTraits>(at.bsdf, at.wo_local, u_lobe,
                                                            {0.5f, 0.5f});
      }
    }
    return SampleBsdf<kTraits>(at.bsdf, at.wo_local, u_lobe, Vec2f{0.5f, 0.5f});
  };
  constexpr int kLobes = 64;
  for (int i = 0; i < kLobes; ++i) {
    const auto sample = sample_by((static_cast<float>(i) + 0.5f) / kLobes);
    if (sample && (sample->flags & kBsdfSpecular) != 0 &&
        Length(at.point.shading.ToWorld(sample->wi) - w) < 1e-3f) {
      return sample;
    }
  }
  return std::nullopt;
}

}  // namespace sheaf::render
