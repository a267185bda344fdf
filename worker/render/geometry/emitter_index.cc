// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// From emitters of the light table to the primitives that have them.
#include <algorithm>

#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {

void IndexEmitters(SceneGeometry* geometry) {
  const GeometryGroup& world = geometry->groups[0];
  std::vector<EmitterRange>& ranges = geometry->emitters;
  ranges.clear();
  for (uint32_t i = 0; i < world.meshes.size(); ++i) {
    const BakedMesh& mesh = world.meshes[i];
    if (mesh.surface.emitter == kNoEmitter) continue;
    const uint32_t cells = mesh.surface.emission_cells;
    const auto triangles = static_cast<uint32_t>(mesh.indices.size() / 3);
    ranges.push_back({mesh.surface.emitter, i, 0, cells * cells, cells * cells * triangles});
  }
  for (uint32_t i = 0; i < world.quadrics.size(); ++i) {
    const Surface& surface = world.quadrics[i].surface;
    if (surface.emitter == kNoEmitter) continue;
    ranges.push_back({surface.emitter, world.QuadricsId(), i, 1, 1});
  }
  std::sort(ranges.begin(), ranges.end(),
            [](const EmitterRange& a, const EmitterRange& b) { return a.first < b.first; });
}

std::optional<PrimitiveId> PrimitiveOfEmitter(const SceneGeometry& geometry, uint32_t emitter) {
  const std::vector<EmitterRange>& ranges = geometry.emitters;
  const auto after =
      std::upper_bound(ranges.begin(), ranges.end(), emitter,
                       [](uint32_t id, const EmitterRange& range) { return id < range.first; });
  if (after == ranges.begin()) return std::nullopt;
  const EmitterRange& range = *(after - 1);
  const uint32_t index = emitter - range.first;
  if (index >= range.count) return std::nullopt;
  return PrimitiveId{range.geometry, range.primitive + index / range.per_primitive};
}

}  // namespace sheaf::render
