// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/plan/specular_surfaces.h"

#include <algorithm>
#include <variant>

namespace sheaf::render {
namespace {

// Above this roughness no surface is smooth, whatever its map from roughness to GGX widths.
constexpr float kSmoothRoughnessMax = 0.04f;

bool MayBeSmooth(const FloatInput& roughness) {
  return roughness.texture != kNone || roughness.value <= kSmoothRoughnessMax;
}
bool MayBeSmooth(const RoughnessInput& roughness) {
  return MayBeSmooth(roughness.u) && MayBeSmooth(roughness.v);
}
bool MayBePositive(const FloatInput& input) { return input.texture != kNone || input.value > 0; }

template <typename Material>
bool MayBeSpecular(const Material&) {
  return false;
}
bool MayBeSpecular(const ConductorMaterial& m) { return MayBeSmooth(m.roughness); }
bool MayBeSpecular(const DielectricMaterial& m) { return MayBeSmooth(m.roughness); }
bool MayBeSpecular(const SubsurfaceMaterial& m) { return MayBeSmooth(m.roughness); }
bool MayBeSpecular(const ThinDielectricMaterial&) { return true; }
bool MayBeSpecular(const CoatedConductorMaterial& m) {
  return MayBeSmooth(m.roughness) && MayBeSmooth(m.conductor.roughness);
}
bool MayBeSpecular(const PrincipledMaterial& m) {
  return MayBeSmooth(m.roughness) && (MayBePositive(m.metallic) || MayBePositive(m.transmission));
}

}  // namespace

bool MayHaveSpecularSurfaces(const SceneDescription& scene) {
  return std::ranges::any_of(scene.materials, [](const MaterialDescription& description) {
    return std::visit([](const auto& m) { return MayBeSpecular(m); }, description.material);
  });
}

}  // namespace sheaf::render
