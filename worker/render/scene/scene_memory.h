// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneMemory: the memory that a compiled scene holds, by kind.
#pragma once

#include <cstdint>

#include "common/volume/volume_pages.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::render {

struct SceneMemory {
  uint64_t description_bytes = 0;  // The rest of the scene file: names, shapes, grids.
  uint64_t mesh_bytes = 0;         // Vertices, indices, curves and where groups are placed.
  uint64_t tracer_bytes = 0;       // Embree's trees.
  uint64_t material_bytes = 0;     // Materials and the tables of their scattering.
  uint64_t texture_bytes = 0;      // Images and tiles that are in memory now.
  uint64_t light_bytes = 0;        // Lights, their tree, their images, and emission.
  uint64_t environment_bytes = 0;  // Maps of lights from all directions.
  uint64_t volume_bytes = 0;       // Grids with their bounds.
  uint64_t page_bytes = 0;         // Pages of page files that are in memory now.
  uint64_t guiding_bytes = 0;      // Learned fields; 0 before the training.
  uint64_t light_pass_bytes = 0;   // The most that light passes under way take; set by who does.
};

// Thread safety: as for rendering.
SceneMemory MemoryOf(const CompiledScene& scene);

// Pages of page files.
struct ScenePages {
  volume::PageCounts counts;    // Their use so far.
  uint64_t resident_bytes = 0;  // In memory now.
};
// Thread safety: as for rendering.
ScenePages PagesOf(const CompiledScene& scene);

}  // namespace sheaf::render
