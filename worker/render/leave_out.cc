// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// One way of leaving out for each trait.
#include "worker/render/leave_out.h"

#include <algorithm>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/half_space.h"
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
                         std::is_same_v<Old, ThinDielectricMaterial> ||
                         std::is_same_v<Old, SubsurfaceMaterial>) {
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
    if (const auto* skin = std::get_if<SubsurfaceMaterial>(&kind)) return skin->eta.IsMatched();
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

// Takes away media, and what refers to them.
template <typename Predicate>
void RemoveMedia(SceneDescription* scene, const Predicate& is_removed) {
  std::vector<MediumDescription> kept;
  std::vector<int32_t> index_of;
  for (MediumDescription& medium : scene->media) {
    const bool goes = is_removed(medium);
    index_of.push_back(goes ? kNone : static_cast<int32_t>(kept.size()));
    if (!goes) kept.push_back(std::move(medium));
  }
  scene->media = std::move(kept);
  const auto move = [&](int32_t* index) {
    if (*index != kNone) *index = index_of[static_cast<size_t>(*index)];
  };
  move(&scene->camera.medium);
  for (ShapeDescription& shape : scene->shapes) {
    move(&shape.media.inside);
    move(&shape.media.outside);
  }
  for (MaterialDescription& material : scene->materials) {
    auto* subsurface = std::get_if<SubsurfaceMaterial>(&material.material);
    if (subsurface != nullptr) move(&subsurface->medium);
  }
}

void ClearTheAir(SceneDescription* scene) {
  RemoveMedia(scene, [](const MediumDescription& medium) { return !medium.is_matter; });
}

// Diffuse as even light would see the matter.
void MakeSkinDeep(SceneDescription* scene) {
  ChangeMaterials(scene, [scene](const auto& old, auto* material) {
    if constexpr (std::is_same_v<std::decay_t<decltype(old)>, SubsurfaceMaterial>) {
      const MediumDescription& matter = scene->media[static_cast<size_t>(old.medium)];
      ColorInput reflectance;
      for (size_t c = 0; c < 3; ++c) {
        const auto a = static_cast<double>(matter.sigma_a.rgb[c]);
        const double s =
            static_cast<double>(matter.sigma_s.rgb[c]) * (1 - static_cast<double>(matter.g));
        const double albedo = s > 0 ? s / (a + s) : 0;
        reflectance.value.rgb[c] =
            static_cast<float>(HalfSpaceReflectance(albedo, static_cast<double>(old.eta.mean)));
      }
      *material = DiffuseMaterial{reflectance};
    }
  });
  RemoveMedia(scene, [](const MediumDescription& medium) { return medium.is_matter; });
}

void ForgetPriorities(SceneDescription* scene) {
  for (MaterialDescription& material : scene->materials) material.priority.reset();
}

void MakeGreyWhatIsColored(SceneDescription* scene) {
  for (MediumDescription& medium : scene->media) {
    for (ColorSpec* color : {&medium.sigma_a, &medium.sigma_s}) {
      const Rgb rgb = color->rgb;
      *color = {};
      color->rgb = Rgb::Grey((rgb.r + rgb.g + rgb.b) / 3);
    }
    if (std::holds_alternative<RgbGridMedium>(medium.kind)) medium.kind = HomogeneousMedium{};
  }
}

// The same of what paths can be in.
void ChangeInsides(Trait trait, SceneWithout* without) {
  SceneDescription* scene = &without->scene;
  switch (trait) {
    case Trait::kMedia:
      without->how = "without media";
      return ClearTheAir(scene);
    case Trait::kHeterogeneousMedia:
      without->how = "media are the same everywhere";
      for (MediumDescription& medium : scene->media) medium.kind = HomogeneousMedium{};
      return;
    case Trait::kChromaticMedia:
      without->how = "media are grey";
      return MakeGreyWhatIsColored(scene);
    case Trait::kEmissiveMedia:
      without->how = "media do not shine";
      for (MediumDescription& medium : scene->media) medium.emits = false;
      return;
    case Trait::kSubsurface:
      without->how = "matter is as bright and opaque";
      return MakeSkinDeep(scene);
    case Trait::kNestedDielectrics:
      without->how = "priorities are forgotten";
      return ForgetPriorities(scene);
    default:
      return;
  }
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
    case Trait::kMedia:
    case Trait::kHeterogeneousMedia:
    case Trait::kChromaticMedia:
    case Trait::kEmissiveMedia:
    case Trait::kSubsurface:
    case Trait::kNestedDielectrics:
      return ChangeInsides(trait, without);
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
