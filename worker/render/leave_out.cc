// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// One way of leaving out for each trait.
#include "worker/render/leave_out.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "worker/render/lens_system.h"
#include "worker/render/plain_shape.h"
#include "worker/render/texture_mean.h"
#include "worker/render/trait_set.h"

namespace sheaf::render {
namespace {

// What stands for surfaces that have no plainer form of their own.
constexpr float kPlainReflectance = 0.5f;

void StandStill(SceneDescription* scene) {
  const auto hold = [](TransformOverTime* transform) { transform->end = transform->start; };
  hold(&scene->camera.world_from_camera);
  for (ShapeDescription& shape : scene->shapes) hold(&shape.world_from_object);
  for (ObjectInstance& instance : scene->instances) hold(&instance.world_from_instance);
  scene->camera.shutter_close = scene->camera.shutter_open;
}

void RemoveLights(SceneDescription* scene, bool infinite) {
  std::erase_if(scene->lights, [infinite](const LightDescription& light) {
    return std::holds_alternative<InfiniteLight>(light.light) == infinite;
  });
}

template <typename Change>
void ChangeMaterials(SceneDescription* scene, const Change& change) {
  for (MaterialDescription& description : scene->materials) {
    std::visit(
        [&](auto& material) {
          // A copy: the change may put another kind of material in its place.
          const auto old = material;
          change(old, &description.material);
        },
        description.material);
  }
}

ColorInput Grey(float value) {
  ColorInput input;
  input.value.rgb = Rgb::Grey(value);
  return input;
}

// Reflectance at normal incidence of an index n + i k. Source: Born and Wolf, 1.5.2 and 14.2.
Rgb NormalReflectance(Rgb n, Rgb k) {
  Rgb reflectance;
  for (size_t c = 0; c < 3; ++c) {
    const float below = n[c] - 1, above = n[c] + 1;
    reflectance[c] = (below * below + k[c] * k[c]) / (above * above + k[c] * k[c]);
  }
  return reflectance;
}

DiffuseMaterial DiffuseMetal(const ConductorMaterial& metal) {
  if (metal.has_reflectance) return {metal.reflectance};
  if (metal.eta.texture != kNone || metal.k.texture != kNone) return {Grey(kPlainReflectance)};
  ColorInput reflectance;
  reflectance.value.rgb = NormalReflectance(metal.eta.value.rgb, metal.k.value.rgb);
  return {reflectance};
}

void MakeOpaque(SceneDescription* scene) {
  ChangeMaterials(scene, [](const auto& old, auto* material) {
    using Old = std::decay_t<decltype(old)>;
    if constexpr (std::is_same_v<Old, DiffuseTransmissionMaterial>) {
      *material = DiffuseMaterial{old.reflectance};
    } else if constexpr (std::is_same_v<Old, DielectricMaterial> ||
                         std::is_same_v<Old, ThinDielectricMaterial>) {
      if (!old.eta.IsMatched()) *material = DiffuseMaterial{Grey(kPlainReflectance)};
    }
  });
}

void TakeOffCoats(SceneDescription* scene) {
  ChangeMaterials(scene, [](const auto& old, auto* material) {
    using Old = std::decay_t<decltype(old)>;
    if constexpr (std::is_same_v<Old, CoatedDiffuseMaterial>) {
      *material = DiffuseMaterial{old.reflectance};
    } else if constexpr (std::is_same_v<Old, CoatedConductorMaterial>) {
      *material = old.conductor;
    }
  });
}

void MakeDiffuse(SceneDescription* scene) {
  TakeOffCoats(scene);
  ChangeMaterials(scene, [](const auto& old, auto* material) {
    if constexpr (std::is_same_v<std::decay_t<decltype(old)>, ConductorMaterial>) {
      *material = DiffuseMetal(old);
    }
  });
}

// Cut-outs become whole, mixes their first material, and surfaces that only let light pass go.
void CloseCutOuts(SceneDescription* scene) {
  const auto first_of = [scene](int32_t material) {
    // Mixes hold no cycle, so there are at most as many steps as materials.
    for (size_t step = 0; material != kNone && step < scene->materials.size(); ++step) {
      const auto* mix = std::get_if<MixMaterial>(&scene->materials[material].material);
      if (mix == nullptr) break;
      material = mix->material[0];
    }
    return material;
  };
  const auto only_passes = [scene](int32_t shape) {
    const int32_t material = scene->shapes[shape].material;
    if (material == kNone) return false;
    const auto& kind = scene->materials[material].material;
    if (const auto* glass = std::get_if<DielectricMaterial>(&kind)) return glass->eta.IsMatched();
    if (const auto* pane = std::get_if<ThinDielectricMaterial>(&kind)) return pane->eta.IsMatched();
    return std::holds_alternative<InterfaceMaterial>(kind);
  };
  for (ShapeDescription& shape : scene->shapes) {
    shape.has_alpha = false;
    shape.material = first_of(shape.material);
  }
  std::erase_if(scene->world_shapes, only_passes);
  for (ObjectDefinition& object : scene->objects) std::erase_if(object.shapes, only_passes);
}

template <typename Special>
void MakeGreyWhatIs(SceneDescription* scene) {
  ChangeMaterials(scene, [](const auto& old, auto* material) {
    if constexpr (std::is_same_v<std::decay_t<decltype(old)>, Special>) {
      *material = DiffuseMaterial{Grey(kPlainReflectance)};
    }
  });
}

void RemoveCurves(SceneDescription* scene) {
  const auto is_curve = [scene](int32_t shape) {
    return std::holds_alternative<CurveShape>(scene->shapes[shape].shape);
  };
  std::erase_if(scene->world_shapes, is_curve);
  for (ObjectDefinition& object : scene->objects) std::erase_if(object.shapes, is_curve);
}

void SmoothSurfaces(SceneDescription* scene) {
  for (MaterialDescription& material : scene->materials) {
    material.normal_map = kNone;
    material.displacement = {0, kNone};
  }
}

void ShineEvenly(SceneDescription* scene) {
  for (AreaLightDescription& light : scene->area_lights) light.file.clear();
  for (ShapeDescription& shape : scene->shapes) {
    if (shape.area_light != kNone) shape.has_alpha = false;
  }
}

// A pinhole that sees the same frame. A lens that cannot be focused has none, and says so itself.
void TakeOutLens(SceneDescription* scene) {
  const absl::StatusOr<LensSystem> lens = LensSystem::Make(scene->camera.lens, {});
  const double focal_length_mm = lens.ok() ? lens->focal_length_mm() : 50;
  const double aspect = static_cast<double>(std::max(scene->film.width_px, scene->film.height_px)) /
                        std::min(scene->film.width_px, scene->film.height_px);
  const double shorter_mm =
      static_cast<double>(scene->camera.lens.film_diagonal_mm) / std::sqrt(1 + aspect * aspect);
  scene->camera.kind = CameraDescription::Kind::kPerspective;
  scene->camera.fov_degrees = static_cast<float>(2 * (180 / std::numbers::pi) *
                                                 std::atan(0.5 * shorter_mm / focal_length_mm));
}

void Change(Trait trait, SceneWithout* without) {
  SceneDescription* scene = &without->scene;
  switch (trait) {
    case Trait::kMotion:
      without->how = "all as it is when the shutter opens";
      return StandStill(scene);
    case Trait::kLens:
      without->how = "through a pinhole";
      scene->camera.lens_radius = 0;
      if (scene->camera.IsRealistic()) TakeOutLens(scene);
      return;
    case Trait::kEnvironment:
      without->how = "without infinite lights";
      return RemoveLights(scene, true);
    case Trait::kDeltaLights:
      without->how = "without lights that have no size";
      return RemoveLights(scene, false);
    case Trait::kAreaLights:
      without->how = "shapes that shine are dark";
      for (ShapeDescription& shape : scene->shapes) shape.area_light = kNone;
      return;
    case Trait::kSpecularTransmission:
      without->how = "glass is grey, leaves let no light through";
      return MakeOpaque(scene);
    case Trait::kLayered:
      without->how = "coats are taken off";
      return TakeOffCoats(scene);
    case Trait::kMicrofacet:
      without->how = "metals are diffuse, coats are taken off";
      return MakeDiffuse(scene);
    case Trait::kAlpha:
      without->how = "cut-outs are whole, mixes their first material, interfaces gone";
      return CloseCutOuts(scene);
    case Trait::kInstances:
      without->how = "placed objects are gone";
      scene->instances.clear();
      return;
    case Trait::kQuadrics:
      without->how = "curved shapes are triangles";
      return MakePlain(scene);
    case Trait::kSpectral:
      without->how = "colors as RGB";
      without->settings.color = ColorTransport::kRgb;
      return;
    case Trait::kHair:
      without->how = "hair is grey and diffuse";
      return MakeGreyWhatIs<HairMaterial>(scene);
    case Trait::kMeasured:
      without->how = "what was measured is grey and diffuse";
      return MakeGreyWhatIs<MeasuredMaterial>(scene);
    case Trait::kCurves:
      without->how = "curves are gone";
      return RemoveCurves(scene);
    case Trait::kNormalMaps:
      without->how = "surfaces are as smooth as their shapes";
      return SmoothSurfaces(scene);
    case Trait::kVaryingEmission:
      without->how = "what shines is whole and has no picture";
      return ShineEvenly(scene);
    case Trait::kOutputs:
      without->how = "the picture alone";
      without->settings.outputs = {};
      return;
    case Trait::kTextures:  // LeaveOut's, as it needs files.
      return;
  }
}

}  // namespace

absl::StatusOr<SceneWithout> LeaveOut(Trait trait, const SceneDescription& scene,
                                      const FrameSettings& settings, FileSource& files) {
  SceneWithout without{scene, settings, {}};
  if (trait == Trait::kTextures) {
    without.how = "every texture is its mean";
    SmoothSurfaces(&without.scene);
    if (absl::Status status = ReplaceTexturesByMeans(files, &without.scene); !status.ok()) {
      return status;
    }
  } else {
    Change(trait, &without);
  }
  const RenderPlan plan = MakeRenderPlan(without.scene, without.settings);
  if (!Has(plan.traits, trait)) return without;
  std::string cause;
  for (const PlannedEffect& effect : plan.effects) {
    if (effect.trait == trait) cause = effect.cause;
  }
  return absl::UnimplementedError(absl::StrCat("nothing plainer stands for ", cause));
}

}  // namespace sheaf::render
