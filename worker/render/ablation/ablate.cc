// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The ablation of each trait.
#include "worker/render/ablation/ablate.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/half_space.h"
#include "worker/render/bsdf/lobes.h"
#include "worker/render/camera/lens_system.h"
#include "worker/render/geometry/plain_shape.h"
#include "worker/render/material/texture_mean.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {
namespace {

// Reflectance of surfaces that have no simpler form of their own.
constexpr float kPlainReflectance = 0.5f;

void RemoveDeformation(SceneDescription* scene) {
  for (TriangleMesh& mesh : scene->meshes) mesh.steps.clear();
}

void RemoveMediumMotion(SceneDescription* scene) {
  for (MediumDescription& medium : scene->media) medium.RemoveMotion();
}

void RemoveMotion(SceneDescription* scene) {
  RemoveDeformation(scene);
  RemoveMediumMotion(scene);
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
          // A copy, because the change may replace it by another kind of material.
          const auto old = material;
          change(old, &description.material);
        },
        description.material);
  }
}

ColorInput Gray(float value) {
  ColorInput input;
  input.value.rgb = Rgb::Gray(value);
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
  if (metal.eta.texture != kNone || metal.k.texture != kNone) return {Gray(kPlainReflectance)};
  ColorInput reflectance;
  reflectance.value.rgb = NormalReflectance(metal.eta.value.rgb, metal.k.value.rgb);
  return {reflectance};
}

template <typename Material>
DiffuseMaterial DiffuseLike(const Material& material) {
  if constexpr (DescribedMaterial<Material> && requires { material.reflectance; }) {
    return {material.reflectance};
  } else {
    return {Gray(kPlainReflectance)};
  }
}
DiffuseMaterial DiffuseLike(const ConductorMaterial& metal) { return DiffuseMetal(metal); }
DiffuseMaterial DiffuseLike(const PrincipledMaterial& material) { return {material.base_color}; }

// Replaces the materials that have no plainer form and whose lobe needs the trait.
template <Trait kTrait>
void MakeDiffuseWhatNeeds(SceneDescription* scene) {
  ChangeMaterials(scene, [](const auto& old, auto* material) {
    if constexpr (requires { typename LobeOf<std::decay_t<decltype(old)>>; }) {
      if constexpr (Has(LobeOf<std::decay_t<decltype(old)>>::kTraits, kTrait)) {
        *material = DiffuseLike(old);
      }
    }
  });
}

void MakeOpaque(SceneDescription* scene) {
  ChangeMaterials(scene, [](const auto& old, auto* material) {
    using Old = std::decay_t<decltype(old)>;
    if constexpr (std::is_same_v<Old, DiffuseTransmissionMaterial>) {
      *material = DiffuseMaterial{old.reflectance};
    } else if constexpr (std::is_same_v<Old, DielectricMaterial> ||
                         std::is_same_v<Old, ThinDielectricMaterial> ||
                         std::is_same_v<Old, SubsurfaceMaterial>) {
      if (!old.eta.IsMatched()) *material = DiffuseMaterial{Gray(kPlainReflectance)};
    }
  });
}

void RemoveCoats(SceneDescription* scene) {
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
  RemoveCoats(scene);
  MakeDiffuseWhatNeeds<Trait::kMicrofacet>(scene);
}

// Makes cut-outs opaque, replaces mixes by their first material, and removes null interfaces.
void RemoveCutOuts(SceneDescription* scene) {
  const auto first_of = [scene](int32_t material) {
    // Mixes have no cycle, so there are at most as many steps as materials.
    for (size_t step = 0; material != kNone && step < scene->materials.size(); ++step) {
      const auto* mix = std::get_if<MixMaterial>(&scene->materials[material].material);
      if (mix == nullptr) break;
      material = mix->material[0];
    }
    return material;
  };
  const auto is_null_interface = [scene](int32_t shape) {
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
  std::erase_if(scene->world_shapes, is_null_interface);
  for (ObjectDefinition& object : scene->objects) std::erase_if(object.shapes, is_null_interface);
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
    material.coat_normals.reset();
    material.displacement = {0, kNone};
  }
}

void RemoveVertexNormals(SceneDescription* scene) {
  for (TriangleMesh& mesh : scene->meshes) {
    mesh.normals.clear();
    for (VertexStep& step : mesh.steps) step.normals.clear();
  }
  for (BilinearMesh& mesh : scene->bilinear_meshes) mesh.normals.clear();
}

void ShowEverything(SceneDescription* scene) {
  for (ShapeDescription& shape : scene->shapes) shape.invisible = 0;
  for (LightDescription& light : scene->lights) light.invisible = 0;
  scene->camera.near_clip = 0;
  scene->camera.far_clip = CameraDescription().far_clip;
}

void EmitUniformly(SceneDescription* scene) {
  for (AreaLightDescription& light : scene->area_lights) light.file.clear();
  for (ShapeDescription& shape : scene->shapes) {
    if (shape.area_light != kNone) shape.has_alpha = false;
  }
}

// Replaces the lens by a pinhole with the same frame. A lens that cannot be focused is kept, and
// reports its own error.
void ReplaceLensByPinhole(SceneDescription* scene) {
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

// Removes media and the references to them.
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
  RemoveMedia(scene, [](const MediumDescription& medium) { return !medium.is_subsurface; });
}

// Replaces subsurface media by diffuse surfaces of the same color under uniform light.
void MakeSkinDeep(SceneDescription* scene) {
  ChangeMaterials(scene, [scene](const auto& old, auto* material) {
    if constexpr (std::is_same_v<std::decay_t<decltype(old)>, SubsurfaceMaterial>) {
      const MediumDescription& interior = scene->media[static_cast<size_t>(old.medium)];
      ColorInput reflectance;
      if (interior.reflectance) {
        *material = DiffuseMaterial{{interior.reflectance->color, interior.reflectance->texture}};
        return;
      }
      for (size_t c = 0; c < 3; ++c) {
        const auto a = static_cast<double>(interior.sigma_a.rgb[c]);
        const double s =
            static_cast<double>(interior.sigma_s.rgb[c]) * (1 - static_cast<double>(interior.g));
        const double albedo = s > 0 ? s / (a + s) : 0;
        reflectance.value.rgb[c] =
            static_cast<float>(HalfSpaceReflectance(albedo, static_cast<double>(old.eta.mean)));
      }
      *material = DiffuseMaterial{reflectance};
    }
  });
  RemoveMedia(scene, [](const MediumDescription& medium) { return medium.is_subsurface; });
}

void ForgetPriorities(SceneDescription* scene) {
  for (MaterialDescription& material : scene->materials) material.priority.reset();
}

void RemoveColor(SceneDescription* scene) {
  const auto gray_of = [](Rgb rgb) { return Rgb::Gray((rgb.r + rgb.g + rgb.b) / 3); };
  for (MediumDescription& medium : scene->media) {
    medium.reflectance.reset();
    for (ColorSpec* color : {&medium.sigma_a, &medium.sigma_s}) {
      const Rgb gray = gray_of(color->rgb);
      *color = {};
      color->rgb = gray;
    }
    auto* grid = std::get_if<RgbGridMedium>(&medium.kind);
    if (grid == nullptr) continue;
    for (std::vector<Rgb>* cells : {&grid->sigma_a, &grid->sigma_s}) {
      for (Rgb& cell : *cells) cell = gray_of(cell);
    }
  }
}

// The ablation of each effect. Ablate handles textures itself, because they need files.
struct Change {
  Trait trait;
  const char* how;
  void (*apply)(AblatedScene* without);
};
constexpr Change kChanges[] = {
    {Trait::kMotion, "everything is at rest, as at shutter opening",
     [](AblatedScene* without) { RemoveMotion(&without->scene); }},
    {Trait::kDeformation, "meshes keep their shape at shutter opening",
     [](AblatedScene* without) { RemoveDeformation(&without->scene); }},
    {Trait::kLens, "the camera is a pinhole",
     [](AblatedScene* without) {
       without->scene.camera.lens_radius = 0;
       if (without->scene.camera.IsRealistic()) ReplaceLensByPinhole(&without->scene);
     }},
    {Trait::kEnvironment, "infinite lights are removed",
     [](AblatedScene* without) { RemoveLights(&without->scene, true); }},
    {Trait::kDeltaLights, "delta lights are removed",
     [](AblatedScene* without) { RemoveLights(&without->scene, false); }},
    {Trait::kAreaLights, "emissive shapes are dark",
     [](AblatedScene* without) {
       for (ShapeDescription& shape : without->scene.shapes) shape.area_light = kNone;
     }},
    {Trait::kSpecularTransmission, "glass is gray, leaves are opaque",
     [](AblatedScene* without) { MakeOpaque(&without->scene); }},
    {Trait::kLayered, "coats are removed",
     [](AblatedScene* without) { RemoveCoats(&without->scene); }},
    {Trait::kMicrofacet, "metals are diffuse, coats are removed",
     [](AblatedScene* without) { MakeDiffuse(&without->scene); }},
    {Trait::kAlpha, "cut-outs are whole, mixes are their first material, interfaces are removed",
     [](AblatedScene* without) { RemoveCutOuts(&without->scene); }},
    {Trait::kInstances, "instances are removed",
     [](AblatedScene* without) { without->scene.instances.clear(); }},
    {Trait::kQuadrics, "curved shapes are triangles",
     [](AblatedScene* without) { MakePlain(&without->scene); }},
    {Trait::kSpectral, "colors are RGB",
     [](AblatedScene* without) { without->settings.color = ColorTransport::kRgb; }},
    {Trait::kHair, "hair is grey and diffuse",
     [](AblatedScene* without) { MakeDiffuseWhatNeeds<Trait::kHair>(&without->scene); }},
    {Trait::kMeasured, "what was measured is grey and diffuse",
     [](AblatedScene* without) { MakeDiffuseWhatNeeds<Trait::kMeasured>(&without->scene); }},
    {Trait::kCurves, "curves are gone",
     [](AblatedScene* without) { RemoveCurves(&without->scene); }},
    {Trait::kNormalMaps, "surfaces have neither normal maps nor displacement",
     [](AblatedScene* without) { SmoothSurfaces(&without->scene); }},
    {Trait::kTexturedEmission, "emissive shapes have neither cut-outs nor images",
     [](AblatedScene* without) { EmitUniformly(&without->scene); }},
    {Trait::kOutputs, "only the image is written",
     [](AblatedScene* without) { without->settings.outputs = {}; }},
    {Trait::kMedia, "media are removed",
     [](AblatedScene* without) { ClearTheAir(&without->scene); }},
    {Trait::kHeterogeneousMedia, "media are homogeneous",
     [](AblatedScene* without) {
       for (MediumDescription& medium : without->scene.media) medium.kind = HomogeneousMedium{};
     }},
    {Trait::kMovingVolumes, "media are at rest, as at shutter opening",
     [](AblatedScene* without) { RemoveMediumMotion(&without->scene); }},
    {Trait::kChromaticMedia, "media are gray",
     [](AblatedScene* without) { RemoveColor(&without->scene); }},
    {Trait::kEmissiveMedia, "media do not emit",
     [](AblatedScene* without) {
       for (MediumDescription& medium : without->scene.media) medium.emits = false;
     }},
    {Trait::kSubsurface, "subsurface materials are diffuse, as bright as their interior",
     [](AblatedScene* without) { MakeSkinDeep(&without->scene); }},
    {Trait::kNestedDielectrics, "priorities are ignored",
     [](AblatedScene* without) { ForgetPriorities(&without->scene); }},
    {Trait::kGuiding, "directions are sampled by materials and media alone",
     [](AblatedScene* without) {
       without->settings.techniques = without->settings.techniques.Without(Technique::kGuiding);
     }},
    {Trait::kLearnedLights, "lights are chosen by estimates alone",
     [](AblatedScene* without) {
       without->settings.techniques =
           without->settings.techniques.Without(Technique::kLearnedLights)
               .Without(Technique::kProduct);
     }},
    {Trait::kLightSplits, "each vertex takes one light sample",
     [](AblatedScene* without) { without->settings.light_samples = 0; }},
    {Trait::kPrincipled, "principled materials are diffuse, of their base color",
     [](AblatedScene* without) { MakeDiffuseWhatNeeds<Trait::kPrincipled>(&without->scene); }},
    {Trait::kVertexNormals, "meshes are faceted",
     [](AblatedScene* without) { RemoveVertexNormals(&without->scene); }},
    {Trait::kRayVisibility, "all rays see all shapes and lights",
     [](AblatedScene* without) { ShowEverything(&without->scene); }},
};
// Textures need files.
static_assert(std::size(kChanges) == kTraitCount - 1);

}  // namespace

absl::StatusOr<AblatedScene> Ablate(Trait trait, const SceneDescription& scene,
                                    const FrameSettings& settings, FileSource& files) {
  AblatedScene without{scene, settings, {}};
  if (trait == Trait::kTextures) {
    without.how = "every texture is its mean";
    SmoothSurfaces(&without.scene);
    if (absl::Status status = ReplaceTexturesByMeans(files, &without.scene); !status.ok()) {
      return status;
    }
  } else {
    for (const Change& change : kChanges) {
      if (change.trait != trait) continue;
      without.how = change.how;
      change.apply(&without);
    }
  }
  const RenderPlan plan = MakeRenderPlan(without.scene, without.settings);
  if (!Has(plan.traits, trait)) return without;
  std::string cause;
  for (const PlannedEffect& effect : plan.effects) {
    if (effect.trait == trait) cause = effect.cause;
  }
  return absl::UnimplementedError(absl::StrCat("there is no ablated scene without ", cause));
}

}  // namespace sheaf::render
