// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds the effects that a scene uses, and their causes.
#include "worker/render/plan/render_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/scene/spectrum/spectrum.h"
#include "worker/render/bsdf/perturbed_normal.h"
#include "worker/render/geometry/bilinear_patch.h"
#include "worker/render/medium/similarity.h"
#include "worker/render/plan/film_notes.h"
#include "worker/render/plan/material_traits.h"
#include "worker/render/plan/specular_surfaces.h"
#include "worker/render/plan/technique_plan.h"
#include "worker/render/plan/trait_names.h"
#include "worker/render/plan/vertex_normals.h"
#include "worker/render/traits/variant_choice.h"

namespace sheaf::render {
namespace {

class PlanMaker {
 public:
  explicit PlanMaker(const SceneDescription& scene) : scene_(scene), needs_(scene) {}

  RenderPlan Make(const FrameSettings& settings) {
    ExamineCamera();
    const size_t moving_cameras = causes_[TraitIndex(Trait::kMotion)].count;
    for (const int32_t shape : scene_.world_shapes) ExamineShape(scene_.shapes[shape], true);
    ExamineInstances();
    for (const LightDescription& light : scene_.lights) ExamineLight(light);
    for (const MediumDescription& medium : scene_.media) {
      if (!medium.is_subsurface) ExamineMedium(medium);
    }
    light_count_ += scene_.lights.size();
    Cause& wavelengths = causes_[TraitIndex(Trait::kSpectral)];
    if (settings.color == ColorTransport::kSpectral) {
      wavelengths = {"requested: spectral color", 1};
    } else if (settings.color == ColorTransport::kRgb) {
      wavelengths = {};
    }
    if (!settings.outputs.empty()) {
      causes_[TraitIndex(Trait::kOutputs)] = {
          absl::StrCat("requested: ", FormatOutputs(settings.outputs)), 1};
    }
    for (const auto trait : {Trait::kGuiding, Trait::kLightSplits, Trait::kLearnedLights}) {
      if (Has(TechniqueTraits(settings), trait)) causes_[TraitIndex(trait)] = {"requested", 1};
    }
    RenderPlan plan = Finish(settings);
    BoundDepth(settings.max_depth, &plan);
    plan.notes = std::move(notes_);
    PlanTechniques(scene_, settings.techniques, &plan);
    const bool world_moves = causes_[TraitIndex(Trait::kMotion)].count > moving_cameras;
    NoteSharedPaths(scene_, settings, world_moves, &plan.notes);
    for (std::string& note : SimilarityNotes(scene_, settings.similarity_after)) {
      plan.notes.push_back(std::move(note));
    }
    AddFilmNotes(settings, Has(plan.traits, Trait::kSpectral), &plan.notes);
    if (std::string note = ComparisonNote(scene_, settings); !note.empty()) {
      plan.notes.push_back(std::move(note));
    }
    return plan;
  }

 private:
  struct Cause {
    std::string text;
    size_t count = 0;
  };

  // Counts another cause of a trait; the first one is reported.
  void Require(Trait trait, SourceLocation location, const std::string& what) {
    Cause& cause = causes_[TraitIndex(trait)];
    if (cause.count++ == 0) cause.text = absl::StrCat(FormatLocation(scene_, location), ": ", what);
  }
  static size_t TraitIndex(Trait trait) {
    size_t i = 0;
    while (kTraitNames[i].trait != trait) ++i;
    return i;
  }
  bool ShutterIsOpen() const { return scene_.camera.shutter_close > scene_.camera.shutter_open; }

  void ExamineCamera() {
    const CameraDescription& camera = scene_.camera;
    if (!scene_.film.sensor.empty()) {
      Require(Trait::kSpectral, scene_.film.location,
              absl::StrCat("Film \"string sensor\" \"", scene_.film.sensor, "\""));
    }
    if (camera.lens_radius > 0) {
      Require(Trait::kLens, camera.location,
              absl::StrCat("Camera \"float lensradius\" [", camera.lens_radius, "]"));
    }
    if (camera.Clips()) {
      Require(Trait::kRayVisibility, camera.location,
              camera.near_clip > 0 ? "Camera \"float nearclip\"" : "Camera \"float farclip\"");
    }
    if (camera.IsRealistic()) {
      Require(Trait::kLens, camera.location,
              absl::StrCat("Camera \"realistic\" \"string lensfile\" \"", camera.lens.file, "\""));
    }
    if (camera.world_from_camera.IsAnimated() && ShutterIsOpen()) {
      Require(Trait::kMotion, camera.location, "Camera moves while the shutter is open");
    }
  }

  void ExamineShape(const ShapeDescription& shape, bool in_world) {
    if (shape.world_from_object.IsAnimated() && ShutterIsOpen()) {
      Require(Trait::kMotion, shape.location, "Shape moves while the shutter is open");
    }
    const auto* mesh = std::get_if<MeshShape>(&shape.shape);
    if (mesh != nullptr && !scene_.meshes[mesh->mesh].steps.empty() && ShutterIsOpen()) {
      Require(Trait::kMotion, shape.location, "Shape deforms while the shutter is open");
      Require(Trait::kDeformation, shape.location, "Shape deforms while the shutter is open");
    }
    if (std::holds_alternative<SphereShape>(shape.shape)) {
      Require(Trait::kQuadrics, shape.location, "Shape \"sphere\"");
    } else if (std::holds_alternative<DiskShape>(shape.shape)) {
      Require(Trait::kQuadrics, shape.location, "Shape \"disk\"");
    } else if (std::holds_alternative<CylinderShape>(shape.shape)) {
      Require(Trait::kQuadrics, shape.location, "Shape \"cylinder\"");
    } else if (std::holds_alternative<CurveShape>(shape.shape)) {
      Require(Trait::kCurves, shape.location, "Shape \"curve\"");
    } else if (const auto* patches = std::get_if<BilinearMeshShape>(&shape.shape)) {
      if (!IsTriangles(scene_.bilinear_meshes[patches->mesh], shape.area_light != kNone)) {
        Require(Trait::kQuadrics, shape.location, "Shape \"bilinearmesh\"");
      }
    }
    if (shape.area_light != kNone) {
      Require(Trait::kAreaLights, scene_.area_lights[shape.area_light].location,
              "AreaLightSource \"diffuse\"");
      const AreaLightDescription& light = scene_.area_lights[shape.area_light];
      const bool is_new = area_lights_examined_.insert(shape.area_light).second;
      if (is_new) ExamineEmission(light.radiance, light.location);
      if (in_world) ExamineVariation(shape, light);
      // Shapes in objects do not emit.
      if (in_world) light_count_ += CountFaces(shape);
    }
    ExamineNormals(shape, static_cast<double>(kTiltCosineMax));
    if (shape.invisible != 0) Require(Trait::kRayVisibility, shape.location, "\"invisible\"");
    if (shape.has_alpha) {
      Require(Trait::kAlpha, shape.location, "Shape \"alpha\"");
      if (shape.alpha.texture != kNone) ExamineTexture(shape.alpha.texture);
    }
    ExamineMaterial(shape.material);
  }

  void ExamineNormals(const ShapeDescription& shape, double cosine_max) {
    if (causes_[TraitIndex(Trait::kVertexNormals)].count > 0) return;
    const auto is_tilted = [&](const Matrix4& place) {
      const Affine target_from_shape = AffineOf(place);
      if (const auto* mesh = std::get_if<MeshShape>(&shape.shape)) {
        return IsTilted(scene_.meshes[mesh->mesh], target_from_shape, cosine_max);
      }
      const auto* patches = std::get_if<BilinearMeshShape>(&shape.shape);
      return patches != nullptr &&
             IsTilted(scene_.bilinear_meshes[patches->mesh], target_from_shape, cosine_max);
    };
    const TransformOverTime& place = shape.world_from_object;
    if (is_tilted(place.start) || (place.IsAnimated() && is_tilted(place.end))) {
      Require(Trait::kVertexNormals, shape.location, "Shape has normals at an angle to its faces");
    }
  }

  void ExamineEmission(const ColorSpec& color, SourceLocation location) {
    if (IsWithinSrgb(color, ColorRole::kIlluminant)) return;
    Require(Trait::kSpectral, location, "the light's color lies outside sRGB");
  }

  void ExamineVariation(const ShapeDescription& shape, const AreaLightDescription& light) {
    if (!light.file.empty()) {
      Require(Trait::kTextures, light.location, "AreaLightSource \"string filename\"");
      Require(Trait::kTexturedEmission, light.location, "AreaLightSource \"string filename\"");
    } else if (shape.has_alpha) {
      Require(Trait::kTexturedEmission, shape.location, "an emissive shape's \"alpha\"");
    }
  }

  size_t CountFaces(const ShapeDescription& shape) const {
    const auto* mesh = std::get_if<MeshShape>(&shape.shape);
    return mesh == nullptr ? 1 : scene_.meshes[mesh->mesh].indices.size() / 3;
  }

  void ExamineTexture(int32_t texture) {
    Require(Trait::kTextures, scene_.textures[texture].location,
            absl::StrCat("Texture \"", scene_.textures[texture].name, "\""));
  }

  // A material counts once, for any number of shapes that use it.
  void ExamineMaterial(int32_t material) {
    has_scattering_media_ = has_scattering_media_ || material == kNone;
    if (material == kNone || !materials_examined_.insert(material).second) return;
    const MaterialDescription& description = scene_.materials[material];
    has_scattering_media_ = has_scattering_media_ || !IsBlack(description);
    const TraitBits traits = needs_.Of(material).traits;
    const std::string what = description.name.empty()
                                 ? std::string("Material")
                                 : absl::StrCat("material \"", description.name, "\"");
    for (const TraitName& t : kTraitNames) {
      if (Has(traits, t.trait)) Require(t.trait, description.location, what);
    }
    const auto* subsurface = std::get_if<SubsurfaceMaterial>(&description.material);
    if (subsurface != nullptr) ExamineMedium(scene_.media[subsurface->medium]);
  }

  void ExamineInstances() {
    std::set<int32_t> objects_examined;
    for (const ObjectInstance& instance : scene_.instances) {
      const ObjectDefinition& object = scene_.objects[instance.object];
      Require(Trait::kInstances, instance.location,
              absl::StrCat("ObjectInstance \"", object.name, "\""));
      if (instance.world_from_instance.IsAnimated() && ShutterIsOpen()) {
        Require(
            Trait::kMotion, instance.location,
            absl::StrCat("ObjectInstance \"", object.name, "\" moves while the shutter is open"));
      }
      if (objects_examined.insert(instance.object).second) {
        for (const int32_t shape : object.shapes) ExamineShape(scene_.shapes[shape], false);
      }
      ExamineStretching(instance, object);
    }
  }

  // An instance that is stretched tilts normals that depart from their faces at all.
  void ExamineStretching(const ObjectInstance& instance, const ObjectDefinition& object) {
    const TransformOverTime& place = instance.world_from_instance;
    if (KeepsAngles(AffineOf(place.start)) && KeepsAngles(AffineOf(place.end))) return;
    if (!objects_stretched_.insert(instance.object).second) return;
    constexpr double kParallel = 1 - 1e-6;
    for (const int32_t shape : object.shapes) ExamineNormals(scene_.shapes[shape], kParallel);
  }

  void ExamineLight(const LightDescription& light) {
    if (light.invisible != 0) Require(Trait::kRayVisibility, light.location, "\"invisible\"");
    std::visit([&](const auto& kind) { ExamineKind(kind, light.location); }, light.light);
  }
  void ExamineKind(const InfiniteLight& light, SourceLocation location) {
    Require(Trait::kEnvironment, location, "LightSource \"infinite\"");
    if (light.file.empty()) ExamineEmission(light.radiance, location);
  }
  void ExamineKind(const DistantLight& light, SourceLocation location) {
    Require(Trait::kDeltaLights, location, "LightSource \"distant\"");
    ExamineEmission(light.radiance, location);
  }
  void ExamineKind(const PointLight& light, SourceLocation location) {
    Require(Trait::kDeltaLights, location, "LightSource \"point\"");
    ExamineEmission(light.intensity, location);
  }
  void ExamineKind(const SpotLight& light, SourceLocation location) {
    Require(Trait::kDeltaLights, location, "LightSource \"spot\"");
    ExamineEmission(light.intensity, location);
  }
  void ExamineKind(const GoniometricLight& light, SourceLocation location) {
    Require(Trait::kDeltaLights, location, "LightSource \"goniometric\"");
    ExamineEmission(light.intensity, location);
  }
  void ExamineKind(const ProjectionLight&, SourceLocation location) {
    Require(Trait::kDeltaLights, location, "LightSource \"projection\"");
  }

  static bool IsGray(const ColorSpec& color) {
    const Rgb rgb = color.rgb;
    return color.kind == ColorSpec::Kind::kRgb && !color.is_out_of_gamut && rgb.r == rgb.g &&
           rgb.g == rgb.b;
  }

  static bool IsGray(const std::vector<Rgb>& cells) {
    return std::all_of(cells.begin(), cells.end(),
                       [](Rgb cell) { return cell == Rgb::Gray(cell.r); });
  }

  void ExamineMedium(const MediumDescription& medium) {
    const std::string what = medium.is_subsurface ? absl::StrCat("interior of ", medium.name)
                                                  : absl::StrCat("medium \"", medium.name, "\"");
    const auto require = [&](Trait trait) { Require(trait, medium.location, what); };
    require(medium.is_subsurface ? Trait::kSubsurface : Trait::kMedia);
    if (!medium.constant_grid.empty()) {
      notes_.push_back(absl::StrCat(FormatLocation(scene_, medium.location), ": ", what, ": ",
                                    medium.constant_grid));
    }
    const auto* grid = std::get_if<RgbGridMedium>(&medium.kind);
    if (!medium.IsHomogeneous()) require(Trait::kHeterogeneousMedia);
    if (medium.Moves() && ShutterIsOpen()) {
      Require(Trait::kMotion, medium.location,
              absl::StrCat(what, " moves while the shutter is open"));
      require(Trait::kMovingVolumes);
    }
    const bool is_gray = grid != nullptr ? IsGray(grid->sigma_a) && IsGray(grid->sigma_s)
                                         : IsGray(medium.sigma_a) && IsGray(medium.sigma_s);
    const bool is_textured = medium.reflectance && medium.reflectance->texture != kNone;
    if (!is_gray || is_textured) require(Trait::kChromaticMedia);
    if (medium.reflectance && !is_textured &&
        !IsWithinSrgb(medium.reflectance->color, ColorRole::kReflectance)) {
      require(Trait::kSpectral);
    }
    for (const ColorSpec* color : {&medium.sigma_a, &medium.sigma_s}) {
      if (color->is_out_of_gamut) require(Trait::kSpectral);
    }
    const bool scatters = medium.scale > 0 && !medium.sigma_s.rgb.IsBlack();
    has_scattering_media_ = has_scattering_media_ || scatters || grid != nullptr;
    if (!medium.emits || medium.radiance_scale <= 0) return;
    require(Trait::kEmissiveMedia);
    if (!IsWithinSrgb(medium.radiance, ColorRole::kIlluminant)) require(Trait::kSpectral);
    has_emissive_media_ = true;
  }

  static bool IsBlack(const MaterialDescription& description) {
    const auto* diffuse = std::get_if<DiffuseMaterial>(&description.material);
    return diffuse != nullptr && diffuse->reflectance.texture == kNone &&
           diffuse->reflectance.value.kind == ColorSpec::Kind::kRgb &&
           !diffuse->reflectance.value.is_out_of_gamut && diffuse->reflectance.value.rgb.IsBlack();
  }

  void BoundDepth(int32_t max_depth, RenderPlan* plan) const {
    plan->max_depth = max_depth;
    if (max_depth == 0) return;
    if (light_count_ == 0 && !has_emissive_media_) {
      plan->depth_cause = "there is no light";
    } else if (!has_scattering_media_) {
      plan->depth_cause = "every surface is black";
    } else {
      return;
    }
    plan->max_depth = 0;
  }

  RenderPlan Finish(const FrameSettings& settings) const {
    RenderPlan plan;
    plan.light_count = light_count_;
    for (size_t i = 0; i < std::size(kTraitNames); ++i) {
      const TraitName& t = kTraitNames[i];
      if (causes_[i].count == 0) {
        plan.unused.emplace_back(t.name);
        continue;
      }
      plan.traits |= static_cast<TraitBits>(t.trait);
      std::string cause = causes_[i].text;
      if (causes_[i].count > 1) absl::StrAppend(&cause, " (and ", causes_[i].count - 1, " more)");
      plan.effects.push_back({t.trait, t.name, cause, t.time_ratio});
    }
    const Variant variant = VariantFor(plan.traits, settings);
    plan.variant_traits = variant.traits;
    plan.variant_name = variant.name;
    return plan;
  }

  const SceneDescription& scene_;
  const MaterialNeedsTable needs_;
  std::array<Cause, std::size(kTraitNames)> causes_;
  std::set<int32_t> materials_examined_, area_lights_examined_, objects_stretched_;
  std::vector<std::string> notes_;
  size_t light_count_ = 0;
  bool has_scattering_media_ = false, has_emissive_media_ = false;
};

}  // namespace

RenderPlan MakeRenderPlan(const SceneDescription& scene, const FrameSettings& settings) {
  return PlanMaker(scene).Make(settings);
}

}  // namespace sheaf::render
