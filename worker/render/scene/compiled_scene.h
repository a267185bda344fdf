// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CompiledScene: the immutable data that tracing reads.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/accel/embree_scene.h"
#include "worker/render/camera/camera.h"
#include "worker/render/camera/eye_camera.h"
#include "worker/render/camera/film_response.h"
#include "worker/render/color/wavelength_sampler.h"
#include "worker/render/geometry/scene_geometry.h"
#include "worker/render/guiding/guiding_slot.h"
#include "worker/render/light/light_emission.h"
#include "worker/render/light/light_table.h"
#include "worker/render/material/material.h"
#include "worker/render/medium/emission_points.h"
#include "worker/render/medium/medium.h"
#include "worker/render/plan/render_plan.h"
#include "worker/render/sampling/filter.h"
#include "worker/render/scene/compile_scene.h"
#include "worker/render/scene/interior_table.h"
#include "worker/render/scene/ray_visibility.h"
#include "worker/render/scene/scene_ids.h"

namespace sheaf::render {

// The cameras of a stereo frame. Its film is that of both eyes side by side, the left one first.
struct EyePair {
  std::array<Camera, 2> cameras;  // By Eye.
  int32_t width_px = 0;           // The width of the film of each eye.
  const Camera& of(Eye eye) const { return cameras[static_cast<size_t>(eye)]; }
};

class ChainTable;

class CompiledScene {
 public:
  SceneDescription description;  // Without its mesh buffers.
  FrameSettings settings;
  RenderPlan plan;
  SceneGeometry geometry;
  Camera camera;  // In a stereo frame: between the eyes, with a film like theirs.
  std::unique_ptr<const EyePair> eyes;  // Null where the frame has one view.
  PixelFilter filter;
  FilmResponse film;
  WavelengthSampler wavelengths;  // For spectral transport.
  std::unique_ptr<EmbreeScene> tracer;
  std::unique_ptr<MaterialTable> materials;
  std::unique_ptr<LightTable> lights;
  // Where light paths begin; null where the settings have paths from the camera alone.
  std::unique_ptr<LightEmission> emission;
  double light_paths_per_pass = 0;           // One for each pixel of the whole frame.
  bool light_paths_alone = false;            // Technique::kLightPathsAlone.
  std::unique_ptr<GuidingSlot> guiding;      // Null where the settings need no training.
  std::unique_ptr<MediumTable> media;        // Null where the plan has none.
  std::unique_ptr<InteriorTable> interiors;  // Null where the plan has no nested dielectrics.
  float majorant_factor = 1;                 // As in CompileTechniques.
  uint32_t roulette_depth_min = kRouletteDepthMin;
  uint64_t training_paths_first = 0;  // As in CompileTechniques.
  uint32_t media_group = 0;           // Index of the light group of media emission.
  SceneIds ids;                       // Empty unless requested.
  RayVisibility visibility;           // Empty unless the plan has kRayVisibility.
  // Where light paths begin in media; null where `emission` is, or no medium emits.
  std::unique_ptr<EmissionPoints> emission_points;
  // Casters and lamps of chains; null where the settings have no chains.
  std::shared_ptr<const ChainTable> chains;
  // A pass merges light paths with the camera paths of one in this many pixels; 0: of none.
  uint32_t gather_step = 0;
};

}  // namespace sheaf::render
