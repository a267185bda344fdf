// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription + RenderPlan > CompiledScene.
#include "worker/render/scene/compile_tables.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/load_phases.h"
#include "common/base/log.h"
#include "common/scene/film_size.h"
#include "common/scene/settings/ray_visibility_check.h"
#include "worker/render/gather/merging.h"
#include "worker/render/plan/specular_surfaces.h"
#include "worker/render/scene/chain_table.h"
#include "worker/render/scene/scene_baker.h"
#include "worker/render/scene/twin_emitters.h"

namespace sheaf::render {
namespace {

// Makes every hit compute its parameters, whether or not a texture reads them.
void WantParameters(SceneGeometry* geometry) {
  for (GeometryGroup& group : geometry->groups) {
    for (BakedMesh& mesh : group.meshes) mesh.surface.reads_textures = true;
    for (BakedQuadric& quadric : group.quadrics) quadric.surface.reads_textures = true;
    for (BakedPatches& patches : group.patches) patches.surface.reads_textures = true;
  }
}

// A box of render space about the places where rays of the camera, or of both eyes, begin: at the
// corners of the image, over the lens, at several times.
Bounds CameraOrigins(const CompiledScene& scene) {
  constexpr int kTimes = 17;
  Bounds origins;
  const auto add = [&](const Camera& camera, int32_t width_px) {
    for (int n = 0; n < 4 * 9; ++n) {
      const Vec2d film{(n & 1) != 0 ? width_px : 0.0,
                       (n & 2) != 0 ? static_cast<double>(scene.settings.height_px) : 0.0};
      const Vec2f lens{0.5f * static_cast<float>(n / 4 % 3), 0.5f * static_cast<float>(n / 12)};
      for (int time = 0; time < kTimes; ++time) {
        const float fraction = static_cast<float>(time) / (kTimes - 1);
        origins.Add(ToDouble(camera.MakeRay<kAllTraits>(film, lens, fraction).o));
      }
    }
  };
  if (scene.eyes) {
    for (const Camera& eye : scene.eyes->cameras) add(eye, scene.eyes->width_px);
  } else {
    add(scene.camera, scene.settings.width_px);
  }
  return origins;
}

// Builds the table of media, and finds the light group of their emission.
absl::Status BuildMedia(FileSource& files, CompileInput* input, CompiledScene* scene) {
  const PhaseTimer timer(LoadPhase::kMedia, PhaseCpu::kProcess);
  absl::StatusOr<std::unique_ptr<MediumTable>> media =
      MediumTable::Build(scene->description, scene->geometry, std::move(input->velocities), files,
                         {Has(scene->plan.traits, Trait::kSpectral), input->threads,
                          input->techniques.bound_media_once, input->volume_memory_bytes_max});
  if (!media.ok()) return media.status();
  if (absl::Status pages = (*media)->PageStatus(); !pages.ok()) return pages;
  if (input->techniques.merge_media && !input->techniques.bound_media_once) {
    (*media)->MergeOverlapping(scene->description, CameraOrigins(*scene), input->threads,
                               &scene->geometry);
  }
  (*media)->ChooseEquiangular(*scene->lights, input->techniques.equiangular_mode);
  scene->media = *std::move(media);
  scene->majorant_factor = input->techniques.majorant_factor;
  const std::vector<std::string>& groups = scene->settings.outputs.light_groups;
  scene->media_group = static_cast<uint32_t>(
      std::find(groups.begin(), groups.end(), kDefaultLightGroup) - groups.begin());
  return absl::OkStatus();
}

absl::StatusOr<Camera> MakeCamera(const CompiledScene& scene, FileSource* files) {
  const FrameSettings& settings = scene.settings;
  const int32_t width_px = settings.IsStereo() ? settings.width_px / 2 : settings.width_px;
  absl::StatusOr<Camera> camera = Camera::Make(scene.description, width_px, settings.height_px,
                                               scene.geometry.render_origin_world, files);
  if (camera.ok()) camera->set_ray_start_radius(scene.geometry.radius_if_far);
  return camera;
}

// Sets the scene's camera, and those of its eyes.
absl::Status MakeCameras(FileSource& files, CompiledScene* scene) {
  absl::StatusOr<Camera> camera = MakeCamera(*scene, &files);
  if (!camera.ok()) return camera.status();
  scene->camera = *std::move(camera);
  const FrameSettings& settings = scene->settings;
  if (!settings.IsStereo()) return absl::OkStatus();
  auto eyes = std::make_unique<EyePair>();
  eyes->width_px = settings.width_px / 2;
  const CameraDescription between = scene->description.camera;
  for (const Eye eye : {Eye::kLeft, Eye::kRight}) {
    scene->description.camera =
        EyeCamera(between, eye, settings.eye_distance, settings.eye_convergence);
    camera = MakeCamera(*scene, &files);
    scene->description.camera = between;
    if (!camera.ok()) return camera.status();
    eyes->cameras[static_cast<size_t>(eye)] = *std::move(camera);
  }
  scene->eyes = std::move(eyes);
  return absl::OkStatus();
}

absl::Status BuildMaterials(FileSource& files, uint64_t texture_cache_bytes_max,
                            CompiledScene* scene) {
  const PhaseTimer timer(LoadPhase::kMaterials);
  absl::StatusOr<std::unique_ptr<MaterialTable>> materials =
      MaterialTable::Build(scene->description, files,
                           {texture_cache_bytes_max, Has(scene->plan.traits, Trait::kSpectral),
                            scene->settings.single_scattering});
  if (!materials.ok()) return materials.status();
  scene->materials = *std::move(materials);
  return absl::OkStatus();
}

// Builds the table of lights, and assigns their groups.
absl::Status BuildLights(FileSource& files, const CompileTechniques& techniques,
                         LightTableInput emitters, CompiledScene* scene) {
  emitters.spectral = Has(scene->plan.traits, Trait::kSpectral);
  emitters.splits = Has(scene->plan.traits, Trait::kLightSplits);
  emitters.choose_evenly = techniques.choose_lights_evenly;
  absl::StatusOr<std::unique_ptr<LightTable>> lights =
      LightTable::Build(scene->description, std::move(emitters), files);
  if (!lights.ok()) return lights.status();
  scene->lights = *std::move(lights);
  const FilmOutputs& outputs = scene->settings.outputs;
  if (!outputs.light_groups.empty() && !outputs.light_paths) {
    scene->lights->AssignGroups(scene->description, outputs.light_groups);
  }
  return absl::OkStatus();
}

absl::Status BuildRayVisibility(CompiledScene* scene) {
  if (!Has(scene->plan.traits, Trait::kRayVisibility)) return absl::OkStatus();
  if (absl::Status status = CheckRayVisibility(scene->description, scene->settings); !status.ok()) {
    return status;
  }
  absl::StatusOr<RayVisibility> visibility =
      MakeRayVisibility(scene->description, scene->settings, scene->geometry, *scene->lights);
  if (!visibility.ok()) return visibility.status();
  scene->visibility = *std::move(visibility);
  return absl::OkStatus();
}

}  // namespace

absl::Status BuildTechniques(CompiledScene* scene) {
  const PhaseTimer timer(LoadPhase::kLights);
  const FrameSettings& settings = scene->settings;
  if (HasChains(settings.techniques)) {
    scene->chains = std::make_shared<const ChainTable>(scene->plan.chain_shapes, scene->geometry,
                                                       *scene->lights);
  }
  if (NeedsTraining(settings.techniques)) scene->guiding = std::make_unique<GuidingSlot>();
  if (!HasLightPaths(settings.techniques)) return absl::OkStatus();
  if (settings.similarity_after > 0) {
    return absl::InvalidArgumentError(
        "light paths cannot be combined with similarity, whose media depend on the number of "
        "scatterings from the camera: use techniques camera, or no similarity");
  }
  const Vec3d lower = ToDouble(scene->geometry.bounds_lower),
              upper = ToDouble(scene->geometry.bounds_upper);
  double media_power = 0;
  if (scene->media && Has(scene->plan.traits, Trait::kEmissiveMedia)) {
    scene->emission_points =
        std::make_unique<EmissionPoints>(scene->media->MakeEmissionPoints(scene->geometry));
    media_power = scene->emission_points->power();
  }
  scene->emission = std::make_unique<LightEmission>(*scene->lights, 0.5 * (lower + upper),
                                                    0.5 * Length(upper - lower), media_power);
  if (MergesLightPaths(settings.techniques) && MayHaveSpecularSurfaces(scene->description)) {
    scene->gather_step = GatherStep(int64_t{settings.width_px} * settings.height_px);
  }
  scene->light_paths_per_pass =
      static_cast<double>(settings.width_px) * static_cast<double>(settings.height_px);
  scene->light_paths_alone = settings.techniques.Has(Technique::kLightPathsAlone);
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<CompiledScene>> CompileTables(SceneDescription description,
                                                             const FrameSettings& settings,
                                                             FileSource& files,
                                                             CompileInput input) {
  auto scene = std::make_unique<CompiledScene>();
  scene->settings = settings;
  scene->plan = std::move(input.plan);
  scene->settings.max_depth = scene->plan.max_depth;
  ResizeFilm(settings.IsStereo() ? settings.width_px / 2 : settings.width_px, settings.height_px,
             &description);
  RemoveTwinEmitters(&description);
  absl::StatusOr<EmissionMaps> maps = ReadEmissionMaps(description, files);
  if (!maps.ok()) return maps.status();
  absl::StatusOr<BakedScene> baked = BakeScene(&description, *std::move(maps));
  if (!baked.ok()) return baked.status();
  scene->description = std::move(description);
  scene->geometry = std::move(baked->geometry);
  if (settings.outputs.Has(Aov::kUv)) WantParameters(&scene->geometry);
  if (settings.outputs.HasIds()) {
    absl::StatusOr<SceneIds> ids = SceneIds::Make(scene->description, scene->geometry);
    if (!ids.ok()) return ids.status();
    scene->ids = *std::move(ids);
  }
  if (scene->geometry.degenerate_triangle_count > 0) {
    LogWarning(absl::StrCat(
        scene->description.files.empty() ? "scene" : scene->description.files[0], ": ",
        scene->geometry.degenerate_triangle_count, " triangles without area were skipped"));
  }
  if (absl::Status made = MakeCameras(files, scene.get()); !made.ok()) return made;
  absl::StatusOr<PixelFilter> filter = PixelFilter::Make(scene->description);
  if (!filter.ok()) return filter.status();
  scene->filter = *std::move(filter);
  scene->film = FilmResponse::Make(scene->description.film, settings);
  const bool spectral = Has(scene->plan.traits, Trait::kSpectral);
  if (spectral) scene->wavelengths = WavelengthSampler(NarrowBandsOf(scene->description));
  if (absl::Status built = BuildMaterials(files, input.texture_cache_bytes_max, scene.get());
      !built.ok()) {
    return built;
  }
  if (absl::Status built =
          BuildLights(files, input.techniques, std::move(baked->emitters), scene.get());
      !built.ok()) {
    return built;
  }
  if (absl::Status built = BuildRayVisibility(scene.get()); !built.ok()) return built;
  scene->roulette_depth_min = input.techniques.roulette_depth_min;
  if ((scene->plan.traits & kInsides) != 0) {
    const absl::Status built = BuildMedia(files, &input, scene.get());
    if (!built.ok()) return built;
  }
  scene->training_paths_first = input.techniques.training_paths_first;
  if (absl::Status built = BuildTechniques(scene.get()); !built.ok()) return built;
  if (Has(scene->plan.traits, Trait::kNestedDielectrics)) {
    absl::StatusOr<std::unique_ptr<InteriorTable>> interiors =
        InteriorTable::Build(scene->description, scene->media.get(), *scene->materials, spectral,
                             settings.single_scattering, &scene->geometry);
    if (!interiors.ok()) return interiors.status();
    scene->interiors = *std::move(interiors);
  }
  return scene;
}

}  // namespace sheaf::render
