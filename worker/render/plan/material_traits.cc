// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Derives traits from materials.
#include "worker/render/plan/material_traits.h"

#include <cstdint>
#include <optional>
#include <type_traits>
#include <variant>
#include <vector>

#include "common/scene/spectrum/spectrum.h"
#include "worker/render/bsdf/lobes.h"
#include "worker/render/plan/render_plan.h"

namespace sheaf::render {
namespace {

TraitBits Bit(Trait trait) { return static_cast<TraitBits>(trait); }

// The needs of one material, without those of the materials that it mixes.
class NeedsCollector {
 public:
  explicit NeedsCollector(const SceneDescription& scene) : scene_(scene) {}

  MaterialNeeds Collect(const MaterialDescription& description) {
    if (description.priority.has_value()) {
      needs_.traits |= Bit(Trait::kNestedDielectrics);
      needs_.may_pass = has_priority_ = true;
    }
    std::visit([this](const auto& m) { Add(m); }, description.material);
    if (description.normal_map != kNone || description.displacement.texture != kNone ||
        description.coat_normals.has_value()) {
      needs_.traits |= Bit(Trait::kNormalMaps);
      needs_.has_normal_map = needs_.reads_textures = true;
    }
    if (needs_.reads_textures) needs_.traits |= Bit(Trait::kTextures);
    return needs_;
  }

  // The inputs of a described material.
  void Reflectance(const char*, const ColorInput& input, float) { ReadReflectance(input); }
  void Roughness(const RoughnessInput& input) { Read(input); }

 private:
  void Read(const FloatInput& input) { needs_.reads_textures |= input.texture != kNone; }
  void Read(const ColorInput& input) { needs_.reads_textures |= input.texture != kNone; }
  void Read(const RoughnessInput& roughness) {
    Read(roughness.u);
    Read(roughness.v);
    needs_.anisotropic |= roughness.u.texture != roughness.v.texture ||
                          (roughness.u.texture == kNone && roughness.u.value != roughness.v.value);
  }

  // Colors outside the RGB gamut require wavelengths.
  void ReadReflectance(const ColorInput& input) {
    Read(input);
    if (input.texture == kNone && !IsWithinSrgb(input.value, ColorRole::kReflectance)) {
      needs_.traits |= Bit(Trait::kSpectral);
    }
  }
  void ReadMetal(const ConductorMaterial& m) {
    if (m.has_reflectance) {
      ReadReflectance(m.reflectance);
    } else {
      Read(m.eta);
      Read(m.k);
    }
  }

  template <DescribedMaterial Material>
  void Add(const Material& m) {
    needs_.traits |= LobeOf<Material>::kTraits;
    Material::ForEachInput(m, *this);
  }
  void Add(const DiffuseTransmissionMaterial& m) {
    needs_.traits |= Bit(Trait::kSpecularTransmission);
    ReadReflectance(m.reflectance);
    ReadReflectance(m.transmittance);
  }
  void Add(const ConductorMaterial& m) {
    needs_.traits |= Bit(Trait::kMicrofacet);
    Read(m.roughness);
    ReadMetal(m);
  }
  // A matched index makes no surface: MaterialTable makes it an interface.
  void Add(const DielectricMaterial& m) {
    if (m.eta.IsMatched() && !has_priority_) return Add(InterfaceMaterial{});
    needs_.is_boundary = true;
    needs_.traits |= Bit(Trait::kSpecularTransmission);
    if (m.eta.Disperses()) needs_.traits |= Bit(Trait::kSpectral);
    Read(m.roughness);
  }
  void Add(const SubsurfaceMaterial& m) {
    needs_.traits |= Bit(Trait::kSubsurface);
    Add(DielectricMaterial{m.roughness, m.eta});
    const std::optional<SubsurfaceReflectance>& reflectance =
        scene_.media[static_cast<size_t>(m.medium)].reflectance;
    needs_.has_subsurface_texture = reflectance && reflectance->texture != kNone;
    needs_.reads_textures |= needs_.has_subsurface_texture;
  }
  void Add(const ThinDielectricMaterial& m) {
    if (m.eta.IsMatched()) return Add(InterfaceMaterial{});
    needs_.traits |= Bit(Trait::kSpecularTransmission);
    if (m.eta.Disperses()) needs_.traits |= Bit(Trait::kSpectral);
  }
  void Add(const CoatedDiffuseMaterial& m) {
    needs_.traits |= Bit(Trait::kLayered) | Bit(Trait::kMicrofacet);
    Read(m.roughness);
    ReadReflectance(m.reflectance);
    Read(m.albedo);
  }
  void Add(const CoatedConductorMaterial& m) {
    needs_.traits |= Bit(Trait::kLayered) | Bit(Trait::kMicrofacet);
    Read(m.roughness);
    Read(m.conductor.roughness);
    ReadMetal(m.conductor);
    Read(m.albedo);
  }
  void Add(const HairMaterial& m) {
    needs_.traits |= Bit(Trait::kHair);
    needs_.anisotropic = true;  // Fibers follow the tangent.
    if (m.pigment == HairMaterial::Pigment::kReflectance) ReadReflectance(m.color);
    Read(m.color);
    for (const FloatInput* input :
         {&m.eumelanin, &m.pheomelanin, &m.eta, &m.beta_m, &m.beta_n, &m.alpha_degrees}) {
      Read(*input);
    }
  }
  void Add(const MeasuredMaterial& m) {
    needs_.traits |= Bit(Trait::kMeasured);
    needs_.anisotropic |= m.is_anisotropic;
  }
  void Add(const PrincipledMaterial& m) {
    needs_.traits |= Bit(Trait::kPrincipled);
    needs_.is_boundary |= m.transmission.texture != kNone || m.transmission.value > 0;
    needs_.anisotropic |= m.anisotropy.texture != kNone || m.anisotropy.value > 0;
    needs_.reads_textures |= m.anisotropy_direction != kNone;
    ReadReflectance(m.base_color);
    ReadReflectance(m.specular_tint);
    ReadReflectance(m.sheen_color);
    for (const FloatInput* input :
         {&m.metallic, &m.roughness, &m.specular, &m.transmission, &m.coat, &m.iridescence,
          &m.anisotropy, &m.rotation_radians, &m.coat_roughness, &m.sheen_roughness,
          &m.iridescence_thickness_nm}) {
      Read(*input);
    }
  }
  void Add(const MixMaterial& m) {
    needs_.traits |= Bit(Trait::kAlpha);
    Read(m.amount);
    needs_.may_pass = true;
  }
  void Add(const InterfaceMaterial&) {
    needs_.is_boundary = true;
    needs_.traits |= Bit(Trait::kAlpha);
    needs_.may_pass = true;
  }

  const SceneDescription& scene_;
  MaterialNeeds needs_;
  bool has_priority_ = false;  // Then the outside index may differ from 1.
};

void AddNeeds(const MaterialNeeds& part, MaterialNeeds* whole) {
  whole->traits |= part.traits;
  whole->may_pass |= part.may_pass;
  whole->is_boundary |= part.is_boundary;
  whole->anisotropic |= part.anisotropic;
  whole->reads_textures |= part.reads_textures;
  whole->has_normal_map |= part.has_normal_map;
  whole->has_subsurface_texture |= part.has_subsurface_texture;
}

}  // namespace

MaterialNeedsTable::MaterialNeedsTable(const SceneDescription& scene)
    : needs_(scene.materials.size()) {
  for (size_t i = 0; i < needs_.size(); ++i) {
    needs_[i] = NeedsCollector(scene).Collect(scene.materials[i]);
  }
  enum class State : uint8_t { kNew, kOpen, kWhole };
  std::vector<State> states(needs_.size(), State::kNew);
  std::vector<int32_t> open;  // A mix stays below its parts until they are whole.
  for (size_t i = 0; i < needs_.size(); ++i) {
    open.push_back(static_cast<int32_t>(i));
    while (!open.empty()) {
      const auto at = static_cast<size_t>(open.back());
      const auto* mix = std::get_if<MixMaterial>(&scene.materials[at].material);
      if (mix != nullptr && states[at] == State::kNew) {
        states[at] = State::kOpen;
        for (const int32_t part : mix->material) {
          if (part != kNone && states[static_cast<size_t>(part)] == State::kNew) {
            open.push_back(part);
          }
        }
        continue;
      }
      if (mix != nullptr && states[at] == State::kOpen) {
        for (const int32_t part : mix->material) AddNeeds(Of(part), &needs_[at]);
      }
      states[at] = State::kWhole;
      open.pop_back();
    }
  }
}

}  // namespace sheaf::render
