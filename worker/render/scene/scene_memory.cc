// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/scene_memory.h"

#include <variant>

#include "common/base/vector_bytes.h"
#include "worker/render/scene/chain_table.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

uint64_t MeshBytes(const SceneGeometry& geometry) {
  uint64_t bytes = 0;
  for (const GeometryGroup& group : geometry.groups) {
    for (const BakedMesh& mesh : group.meshes) {
      bytes += VectorBytes(mesh.positions, mesh.normals, mesh.uvs, mesh.tangents, mesh.colors,
                           mesh.indices);
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

uint64_t GridBytes(const MediumDescription& medium) {
  if (const auto* grid = std::get_if<UniformGridMedium>(&medium.kind)) {
    return VectorBytes(grid->density, grid->temperature_k, grid->radiance_scale, grid->velocity);
  }
  if (const auto* grid = std::get_if<RgbGridMedium>(&medium.kind)) {
    return VectorBytes(grid->sigma_a, grid->sigma_s, grid->radiance);
  }
  return 0;
}

uint64_t DescriptionBytes(const SceneDescription& scene) {
  uint64_t bytes = VectorBytes(scene.files, scene.textures, scene.materials, scene.media,
                               scene.shapes, scene.world_shapes, scene.objects, scene.instances,
                               scene.matte_names, scene.area_lights, scene.lights);
  for (const MediumDescription& medium : scene.media) bytes += GridBytes(medium);
  for (const ObjectDefinition& object : scene.objects) bytes += VectorBytes(object.shapes);
  return bytes;
}

uint64_t FieldBytes(const CompiledScene& scene) {
  const LearnedFields* const fields = scene.guiding ? scene.guiding->fields() : nullptr;
  if (fields == nullptr) return 0;
  return fields->directions.memory_bytes() + fields->lights.memory_bytes() +
         fields->contributions.memory_bytes() + fields->emission.memory_bytes();
}

}  // namespace

SceneMemory MemoryOf(const CompiledScene& scene) {
  SceneMemory memory;
  memory.description_bytes = DescriptionBytes(scene.description);
  memory.mesh_bytes = MeshBytes(scene.geometry);
  memory.tracer_bytes = scene.tracer->memory_bytes();
  memory.material_bytes = scene.materials->memory_bytes();
  memory.texture_bytes = scene.materials->texture_bytes();
  const ChainSeeds* const seeds = scene.chains ? scene.chains->seeds() : nullptr;
  memory.environment_bytes = scene.lights->environment_bytes();
  memory.light_bytes = scene.lights->memory_bytes() - memory.environment_bytes +
                       (scene.emission ? scene.emission->memory_bytes() : 0) +
                       (scene.emission_points ? scene.emission_points->memory_bytes() : 0) +
                       (seeds != nullptr ? seeds->memory_bytes() : 0);
  memory.volume_bytes = scene.media ? scene.media->memory_bytes() : 0;
  memory.page_bytes = scene.media ? scene.media->page_bytes() : 0;
  memory.guiding_bytes = FieldBytes(scene);
  return memory;
}

ScenePages PagesOf(const CompiledScene& scene) {
  if (scene.media == nullptr) return {};
  return {scene.media->page_counts(), scene.media->page_bytes()};
}

}  // namespace sheaf::render
