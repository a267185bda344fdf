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

#include "common/base/load_phases.h"
#include "worker/render/medium/file_emission.h"
#include "worker/render/medium/medium_velocities.h"
#include "worker/render/plan/chain_shapes.h"
#include "worker/render/scene/compile_tables.h"
#include "worker/render/scene/displacement.h"
#include "worker/render/scene/scene_memory.h"
#include "worker/render/scene/scene_view.h"

namespace sheaf::render {
namespace {

bool IsLitFromOutside(const SceneDescription& scene) {
  return std::any_of(scene.lights.begin(), scene.lights.end(), [](const LightDescription& light) {
    return std::holds_alternative<InfiniteLight>(light.light) ||
           std::holds_alternative<DistantLight>(light.light);
  });
}

absl::StatusOr<ChangeableScenePtr> Compile(SceneDescription description,
                                           const FrameSettings& settings, FileSource& files,
                                           const CompileLimits& limits,
                                           const CompileTechniques& techniques,
                                           bool is_changeable) {
  const PhaseTimer timer(LoadPhase::kTables);
  CompileInput input;
  input.threads = static_cast<int>(limits.build_threads > 0
                                       ? limits.build_threads
                                       : std::max(1u, std::thread::hardware_concurrency()));
  input.texture_cache_bytes_max = limits.texture_cache_bytes_max;
  input.techniques = techniques;
  input.volume_memory_bytes_max = limits.volume_memory_bytes_max;
  absl::StatusOr<MediumVelocities> velocities =
      ReadMediumVelocities(files, input.threads, &description);
  if (!velocities.ok()) return velocities.status();
  input.velocities = *std::move(velocities);
  ResolveFileEmission(files, &description);
  input.plan = MakeRenderPlan(description, settings);
  // Compiling takes the meshes.
  if (is_changeable) input.plan.chain_shapes = FindChainShapes(description);
  const absl::Status displaced = DisplaceMeshes(
      files, {limits.displaced_triangles_max, limits.texture_cache_bytes_max}, &description);
  if (!displaced.ok()) return displaced;
  absl::StatusOr<std::unique_ptr<CompiledScene>> compiled =
      CompileTables(std::move(description), settings, files, std::move(input));
  if (!compiled.ok()) return compiled.status();
  CompiledScene* const scene = compiled->get();
  absl::StatusOr<std::unique_ptr<EmbreeScene>> tracer =
      EmbreeScene::Build(scene->geometry, limits.build_threads);
  if (!tracer.ok()) return tracer.status();
  scene->tracer = *std::move(tracer);
  if (!IsLitFromOutside(scene->description)) scene->tracer->NoteOutsideIsDark();
  FindInteriorsOfCamera(scene);
  return ChangeableScenePtr(compiled->release());
}

}  // namespace

void CompiledSceneDeleter::operator()(const CompiledScene* scene) const { delete scene; }

absl::StatusOr<CompiledScenePtr> CompileScene(SceneDescription description,
                                              const FrameSettings& settings, FileSource& files,
                                              const CompileLimits& limits,
                                              const CompileTechniques& techniques) {
  return Compile(std::move(description), settings, files, limits, techniques, false);
}

absl::StatusOr<ChangeableScenePtr> CompileChangeableScene(SceneDescription description,
                                                          const FrameSettings& settings,
                                                          FileSource& files,
                                                          const CompileLimits& limits,
                                                          const CompileTechniques& techniques) {
  return Compile(std::move(description), settings, files, limits, techniques, true);
}

absl::Status SetTechniques(TechniqueSet techniques, CompiledScene* scene) {
  scene->settings.techniques = techniques;
  scene->plan.traits = (scene->plan.traits & ~kTechniqueTraits) | TechniqueTraits(scene->settings);
  scene->guiding.reset();
  scene->chains.reset();
  scene->emission.reset();
  scene->emission_points.reset();
  scene->light_paths_per_pass = 0;
  scene->light_paths_alone = false;
  scene->gather_step = 0;
  return BuildTechniques(scene);
}

const RenderPlan& PlanOf(const CompiledScene& scene) { return scene.plan; }
const FrameSettings& SettingsOf(const CompiledScene& scene) { return scene.settings; }
uint64_t MemoryBytesOf(const CompiledScene& scene) {
  const SceneMemory memory = MemoryOf(scene);
  return sizeof(CompiledScene) + memory.mesh_bytes + memory.tracer_bytes + memory.material_bytes +
         memory.light_bytes + memory.environment_bytes + memory.volume_bytes;
}

}  // namespace sheaf::render
