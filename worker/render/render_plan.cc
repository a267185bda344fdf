// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds what a scene calls for, and who asked.
#include "worker/render/render_plan.h"

#include <algorithm>
#include <array>
#include <set>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/scene/spectrum.h"
#include "worker/render/bilinear_patch.h"
#include "worker/render/light_choice.h"
#include "worker/render/material_traits.h"
#include "worker/render/variants.h"

namespace sheaf::render {
namespace {

struct TraitName {
  Trait trait;
  const char* name;
};
constexpr TraitName kTraitNames[] = {
    {Trait::kMotion, "motion"},
    {Trait::kLens, "lens"},
    {Trait::kTextures, "textures"},
    {Trait::kNormalMaps, "normal and bump maps"},
    {Trait::kVaryingEmission, "varying emission"},
    {Trait::kEnvironment, "environment"},
    {Trait::kDeltaLights, "delta lights"},
    {Trait::kAreaLights, "area lights"},
    {Trait::kSpecularTransmission, "transmission"},
    {Trait::kLayered, "layered materials"},
    {Trait::kMicrofacet, "microfacets"},
    {Trait::kAlpha, "cut-outs and mixes"},
    {Trait::kInstances, "instances"},
    {Trait::kQuadrics, "curved shapes"},
    {Trait::kSpectral, "wavelengths"},
};

class PlanMaker {
 public:
  explicit PlanMaker(const SceneDescription& scene) : scene_(scene) {}

  RenderPlan Make(const FrameSettings& settings) {
    LookAtCamera();
    for (const int32_t shape : scene_.world_shapes) LookAtShape(scene_.shapes[shape], true);
    LookAtInstances();
    for (const LightDescription& light : scene_.lights) LookAtLight(light);
    light_count_ += scene_.lights.size();
    Cause& wavelengths = causes_[TraitIndex(Trait::kSpectral)];
    if (settings.color == ColorTransport::kSpectral) {
      wavelengths = {"asked for: spectral color", 1};
    } else if (settings.color == ColorTransport::kRgb) {
      wavelengths = {};
    }
    return Finish(settings.force_generic_variant);
  }

 private:
  struct Cause {
    std::string text;
    size_t count = 0;
  };

  // Counts another reason for a trait; the first one is told.
  void Ask(Trait trait, SourceLocation location, const std::string& what) {
    Cause& cause = causes_[TraitIndex(trait)];
    if (cause.count++ == 0) cause.text = absl::StrCat(FormatLocation(scene_, location), ": ", what);
  }
  static size_t TraitIndex(Trait trait) {
    size_t i = 0;
    while (kTraitNames[i].trait != trait) ++i;
    return i;
  }
  bool ShutterIsOpen() const { return scene_.camera.shutter_close > scene_.camera.shutter_open; }

  void LookAtCamera() {
    const CameraDescription& camera = scene_.camera;
    if (camera.lens_radius > 0) {
      Ask(Trait::kLens, camera.location,
          absl::StrCat("Camera \"float lensradius\" [", camera.lens_radius, "]"));
    }
    if (camera.world_from_camera.IsAnimated() && ShutterIsOpen()) {
      Ask(Trait::kMotion, camera.location, "Camera moves while the shutter is open");
    }
  }

  void LookAtShape(const ShapeDescription& shape, bool in_world) {
    if (in_world && shape.world_from_object.IsAnimated() && ShutterIsOpen()) {
      Ask(Trait::kMotion, shape.location, "Shape moves while the shutter is open");
    }
    if (std::holds_alternative<SphereShape>(shape.shape)) {
      Ask(Trait::kQuadrics, shape.location, "Shape \"sphere\"");
    } else if (std::holds_alternative<DiskShape>(shape.shape)) {
      Ask(Trait::kQuadrics, shape.location, "Shape \"disk\"");
    } else if (std::holds_alternative<CylinderShape>(shape.shape)) {
      Ask(Trait::kQuadrics, shape.location, "Shape \"cylinder\"");
    } else if (const auto* patches = std::get_if<BilinearMeshShape>(&shape.shape)) {
      if (!IsTriangles(scene_.bilinear_meshes[patches->mesh], shape.area_light != kNone)) {
        Ask(Trait::kQuadrics, shape.location, "Shape \"bilinearmesh\"");
      }
    }
    if (shape.area_light != kNone) {
      Ask(Trait::kAreaLights, scene_.area_lights[shape.area_light].location,
          "AreaLightSource \"diffuse\"");
      const AreaLightDescription& light = scene_.area_lights[shape.area_light];
      const bool is_new = area_lights_seen_.insert(shape.area_light).second;
      if (is_new) LookAtEmission(light.radiance, light.location);
      if (in_world) LookAtVariation(shape, light);
      // Those of objects do not emit.
      if (in_world) light_count_ += CountFaces(shape);
    }
    if (shape.has_alpha) {
      Ask(Trait::kAlpha, shape.location, "Shape \"alpha\"");
      if (shape.alpha.texture != kNone) LookAtTexture(shape.alpha.texture);
    }
    LookAtMaterial(shape.material);
  }

  void LookAtEmission(const ColorSpec& color, SourceLocation location) {
    if (IsWithinSrgb(color, ColorRole::kIlluminant)) return;
    Ask(Trait::kSpectral, location, "the light's color lies outside of sRGB");
  }

  void LookAtVariation(const ShapeDescription& shape, const AreaLightDescription& light) {
    if (!light.file.empty()) {
      Ask(Trait::kTextures, light.location, "AreaLightSource \"string filename\"");
      Ask(Trait::kVaryingEmission, light.location, "AreaLightSource \"string filename\"");
    } else if (shape.has_alpha) {
      Ask(Trait::kVaryingEmission, shape.location, "an emissive shape's \"alpha\"");
    }
  }

  size_t CountFaces(const ShapeDescription& shape) const {
    const auto* mesh = std::get_if<MeshShape>(&shape.shape);
    return mesh == nullptr ? 1 : scene_.meshes[mesh->mesh].indices.size() / 3;
  }

  void LookAtTexture(int32_t texture) {
    Ask(Trait::kTextures, scene_.textures[texture].location,
        absl::StrCat("Texture \"", scene_.textures[texture].name, "\""));
  }

  // A material counts once, however many shapes use it.
  void LookAtMaterial(int32_t material) {
    if (material == kNone || !materials_seen_.insert(material).second) return;
    const MaterialDescription& description = scene_.materials[material];
    const uint32_t traits = NeedsOfMaterial(scene_, material).traits;
    const std::string what = description.name.empty()
                                 ? std::string("Material")
                                 : absl::StrCat("material \"", description.name, "\"");
    for (const TraitName& t : kTraitNames) {
      if ((traits & static_cast<uint32_t>(t.trait)) != 0) Ask(t.trait, description.location, what);
    }
  }

  void LookAtInstances() {
    std::set<int32_t> objects_seen;
    for (const ObjectInstance& instance : scene_.instances) {
      const ObjectDefinition& object = scene_.objects[instance.object];
      Ask(Trait::kInstances, instance.location,
          absl::StrCat("ObjectInstance \"", object.name, "\""));
      if (instance.world_from_instance.IsAnimated() && ShutterIsOpen()) {
        Ask(Trait::kMotion, instance.location,
            absl::StrCat("ObjectInstance \"", object.name, "\" moves while the shutter is open"));
      }
      if (!objects_seen.insert(instance.object).second) continue;
      for (const int32_t shape : object.shapes) LookAtShape(scene_.shapes[shape], false);
    }
  }

  void LookAtLight(const LightDescription& light) {
    if (const auto* infinite = std::get_if<InfiniteLight>(&light.light)) {
      Ask(Trait::kEnvironment, light.location, "LightSource \"infinite\"");
      if (infinite->file.empty()) LookAtEmission(infinite->radiance, light.location);
    } else if (const auto* distant = std::get_if<DistantLight>(&light.light)) {
      Ask(Trait::kDeltaLights, light.location, "LightSource \"distant\"");
      LookAtEmission(distant->radiance, light.location);
    } else if (const auto* point = std::get_if<PointLight>(&light.light)) {
      Ask(Trait::kDeltaLights, light.location, "LightSource \"point\"");
      LookAtEmission(point->intensity, light.location);
    } else if (const auto* spot = std::get_if<SpotLight>(&light.light)) {
      Ask(Trait::kDeltaLights, light.location, "LightSource \"spot\"");
      LookAtEmission(spot->intensity, light.location);
    } else if (const auto* goniometric = std::get_if<GoniometricLight>(&light.light)) {
      Ask(Trait::kDeltaLights, light.location, "LightSource \"goniometric\"");
      LookAtEmission(goniometric->intensity, light.location);
    } else {
      Ask(Trait::kDeltaLights, light.location, "LightSource \"projection\"");
    }
  }

  RenderPlan Finish(bool force_generic) const {
    RenderPlan plan;
    plan.light_count = light_count_;
    for (size_t i = 0; i < std::size(kTraitNames); ++i) {
      const TraitName& t = kTraitNames[i];
      if (causes_[i].count == 0) {
        plan.unused.emplace_back(t.name);
        continue;
      }
      plan.traits |= static_cast<uint32_t>(t.trait);
      std::string cause = causes_[i].text;
      if (causes_[i].count > 1) absl::StrAppend(&cause, " (and ", causes_[i].count - 1, " more)");
      plan.effects.push_back({t.trait, t.name, cause});
    }
    const Variant variant = AllVariants()[ChooseVariant(plan.traits, force_generic)];
    plan.variant_traits = variant.traits;
    plan.variant_name = variant.name;
    return plan;
  }

  const SceneDescription& scene_;
  std::array<Cause, std::size(kTraitNames)> causes_;
  std::set<int32_t> materials_seen_, area_lights_seen_;
  size_t light_count_ = 0;
};

std::string JoinNames(const std::vector<std::string>& names) {
  std::string joined;
  for (const std::string& name : names) absl::StrAppend(&joined, joined.empty() ? "" : ", ", name);
  return joined;
}

}  // namespace

RenderPlan MakeRenderPlan(const SceneDescription& scene, const FrameSettings& settings) {
  return PlanMaker(scene).Make(settings);
}

std::string FormatRenderPlan(const RenderPlan& plan) {
  size_t width = 0;
  for (const PlannedEffect& effect : plan.effects) width = std::max(width, effect.name.size());
  std::string text;
  for (const PlannedEffect& effect : plan.effects) {
    absl::StrAppend(&text, effect.name, std::string(width - effect.name.size() + 2, ' '),
                    effect.cause, "\n");
  }
  if (!plan.unused.empty()) absl::StrAppend(&text, "not used: ", JoinNames(plan.unused), "\n");
  absl::StrAppend(&text, "lights: ", plan.light_count,
                  plan.light_count > kLightsWeighedMax ? ", chosen by a hierarchy\n"
                                                       : ", each weighed at every point\n");
  std::vector<std::string> carried;
  for (const TraitName& t : kTraitNames) {
    const auto bit = static_cast<uint32_t>(t.trait);
    if ((plan.variant_traits & bit) != 0 && (plan.traits & bit) == 0) carried.emplace_back(t.name);
  }
  absl::StrAppend(&text, "variant: ", plan.variant_name);
  if (!carried.empty()) absl::StrAppend(&text, " (also holds ", JoinNames(carried), ")");
  absl::StrAppend(&text, "\n");
  return text;
}

}  // namespace sheaf::render
