// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription + RenderPlan > CompiledScene.
#include "worker/render/scene/compiled_scene.h"

#include <algorithm>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/vector_bytes.h"
#include "worker/render/medium/medium_velocities.h"
#include "worker/render/scene/displacement.h"
#include "worker/render/scene/scene_baker.h"

namespace sheaf::render {
namespace {

uint64_t GeometryBytes(const SceneGeometry& geometry) {
  uint64_t bytes = 0;
  for (const GeometryGroup& group : geometry.groups) {
    for (const BakedMesh& mesh : group.meshes) {
      bytes += VectorBytes(mesh.positions, mesh.normals, mesh.uvs, mesh.tangents, mesh.indices);
      for (const VertexStep& step : mesh.steps) bytes += VectorBytes(step.positions, step.normals);
    }
    for (const BakedPatches& patches : group.patches) {
      bytes += VectorBytes(patches.positions, patches.normals, patches.uvs, patches.indices);
    }
    for (const BakedCurves& curves : group.curves) {
      bytes += VectorBytes(curves.set.points, curves.set.normals, curves.set.widths, curves.pieces,
                           curves.rods);
    }
    bytes += VectorBytes(group.quadrics);
  }
  return bytes + VectorBytes(geometry.still, geometry.moving, geometry.motions);
}

// Makes every hit compute its parameters, whether or not a texture reads them.
void WantParameters(SceneGeometry* geometry) {
  for (GeometryGroup& group : geometry->groups) {
    for (BakedMesh& mesh : group.meshes) mesh.surface.reads_textures = true;
    for (BakedQuadric& quadric : group.quadrics) quadric.surface.reads_textures = true;
    for (BakedPatches& patches : group.patches) patches.surface.reads_textures = true;
  }
}

// Builds what light paths and guiding need, if the frame has any. Requires: the tables of lights
// and media are complete.
absl::Status BuildTechniques(CompiledScene* scene) {
  const FrameSettings& settings = scene->settings;
  if (IsGuided(settings.techniques)) scene->guiding = std::make_unique<GuidingSlot>();
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
  scene->light_paths_per_pass =
      static_cast<double>(settings.width_px) * static_cast<double>(settings.height_px);
  scene->light_paths_alone = settings.techniques == Techniques::kLight;
  return absl::OkStatus();
}

// Builds the table of media, and finds the light group of their emission.
absl::Status BuildMedia(FileSource& files, int threads, const CompileTechniques& techniques,
                        MediumVelocities velocities, CompiledScene* scene) {
  absl::StatusOr<std::unique_ptr<MediumTable>> media = MediumTable::Build(
      scene->description, scene->geometry, std::move(velocities), files,
      {Has(scene->plan.traits, Trait::kSpectral), threads, techniques.bound_media_once});
  if (!media.ok()) return media.status();
  (*media)->ChooseEquiangular(*scene->lights, techniques.equiangular_mode);
  scene->media = *std::move(media);
  scene->majorant_factor = techniques.majorant_factor;
  const std::vector<std::string>& groups = scene->settings.outputs.light_groups;
  scene->media_group = static_cast<uint32_t>(
      std::find(groups.begin(), groups.end(), kDefaultLightGroup) - groups.begin());
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

bool IsLitFromOutside(const SceneDescription& scene) {
  return std::any_of(scene.lights.begin(), scene.lights.end(), [](const LightDescription& light) {
    return std::holds_alternative<InfiniteLight>(light.light) ||
           std::holds_alternative<DistantLight>(light.light);
  });
}

}  // namespace

void CompiledSceneDeleter::operator()(const CompiledScene* scene) const { delete scene; }

absl::StatusOr<CompiledScenePtr> CompileScene(SceneDescription description,
                                              const FrameSettings& settings, FileSource& files,
                                              const CompileLimits& limits,
                                              const CompileTechniques& techniques) {
  auto scene = std::make_unique<CompiledScene>();
  scene->settings = settings;
  const int threads = static_cast<int>(limits.build_threads > 0
                                           ? limits.build_threads
                                           : std::max(1u, std::thread::hardware_concurrency()));
  absl::StatusOr<MediumVelocities> velocities = ReadMediumVelocities(files, threads, &description);
  if (!velocities.ok()) return velocities.status();
  scene->plan = MakeRenderPlan(description, settings);
  scene->settings.max_depth = scene->plan.max_depth;
  const absl::Status displaced = DisplaceMeshes(
      files, {limits.displaced_triangles_max, limits.texture_cache_bytes_max}, &description);
  if (!displaced.ok()) return displaced;
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
  absl::StatusOr<Camera> camera =
      Camera::Make(scene->description, settings.width_px, settings.height_px,
                   scene->geometry.render_origin_world, &files);
  if (!camera.ok()) return camera.status();
  scene->camera = *camera;
  scene->camera.set_ray_start_radius(scene->geometry.radius_if_far);
  absl::StatusOr<PixelFilter> filter = PixelFilter::Make(scene->description);
  if (!filter.ok()) return filter.status();
  scene->filter = *std::move(filter);
  scene->film = FilmResponse::Make(scene->description.film, settings);
  const bool spectral = Has(scene->plan.traits, Trait::kSpectral);
  if (spectral) scene->wavelengths = WavelengthSampler(NarrowBandsOf(scene->description));
  absl::StatusOr<std::unique_ptr<MaterialTable>> materials =
      MaterialTable::Build(scene->description, files,
                           {limits.texture_cache_bytes_max, spectral, settings.single_scattering});
  if (!materials.ok()) return materials.status();
  scene->materials = *std::move(materials);
  if (absl::Status built = BuildLights(files, techniques, std::move(baked->emitters), scene.get());
      !built.ok()) {
    return built;
  }
  scene->roulette_depth_min = techniques.roulette_depth_min;
  if ((scene->plan.traits & kInsides) != 0) {
    const absl::Status built =
        BuildMedia(files, threads, techniques, *std::move(velocities), scene.get());
    if (!built.ok()) return built;
  }
  scene->training_paths_first = techniques.training_paths_first;
  if (absl::Status built = BuildTechniques(scene.get()); !built.ok()) return built;
  if (Has(scene->plan.traits, Trait::kNestedDielectrics)) {
    absl::StatusOr<std::unique_ptr<InteriorTable>> interiors =
        InteriorTable::Build(scene->description, scene->media.get(), *scene->materials, spectral,
                             settings.single_scattering, &scene->geometry);
    if (!interiors.ok()) return interiors.status();
    scene->interiors = *std::move(interiors);
  }
  absl::StatusOr<std::unique_ptr<EmbreeScene>> tracer =
      EmbreeScene::Build(scene->geometry, limits.build_threads);
  if (!tracer.ok()) return tracer.status();
  scene->tracer = *std::move(tracer);
  if (!IsLitFromOutside(scene->description)) scene->tracer->NoteOutsideIsDark();
  if (scene->interiors) {
    const Ray center =
        scene->camera.MakeRay<0>({settings.width_px / 2.0, settings.height_px / 2.0}, {}, 0);
    scene->interiors->FindEnclosing(scene->geometry, *scene->tracer, center.o);
  }
  return CompiledScenePtr(scene.release());
}

absl::Status SetTechniques(Techniques techniques, CompiledScenePtr* scene) {
  // CompileScene made it, and not as a constant.
  auto& changed = const_cast<CompiledScene&>(**scene);
  changed.settings.techniques = techniques;
  changed.plan.traits =
      (changed.plan.traits & ~kTechniqueTraits) | TechniqueTraits(changed.settings);
  changed.guiding.reset();
  changed.emission.reset();
  changed.emission_points.reset();
  changed.light_paths_per_pass = 0;
  changed.light_paths_alone = false;
  return BuildTechniques(&changed);
}

const RenderPlan& PlanOf(const CompiledScene& scene) { return scene.plan; }
const FrameSettings& SettingsOf(const CompiledScene& scene) { return scene.settings; }
uint64_t MemoryBytesOf(const CompiledScene& scene) {
  return sizeof(CompiledScene) + GeometryBytes(scene.geometry) + scene.tracer->memory_bytes() +
         scene.materials->memory_bytes() + scene.lights->memory_bytes() +
         (scene.emission ? scene.emission->memory_bytes() : 0) +
         (scene.emission_points ? scene.emission_points->memory_bytes() : 0) +
         (scene.media ? scene.media->memory_bytes() : 0);
}

}  // namespace sheaf::render
