// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneBaker: SceneDescription > SceneGeometry, and the emissive shapes for the light table.
#pragma once

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"
#include "worker/render/geometry/scene_geometry.h"
#include "worker/render/light/light_table.h"

namespace sheaf::render {

struct BakedScene {
  SceneGeometry geometry;
  LightTableInput emitters;
};

// Bakes the scene's shapes and collects the emissive ones. Moves the mesh buffers out of `scene`
// (scene->meshes, bilinear_meshes and curve_sets are empty afterwards); a mesh that only one shape
// uses is not copied. maps: the images of scene->area_lights. Errors: kInvalidArgument, with the
// location of the shape: a singular transform, coordinates beyond the range of float, an emissive
// shape that moves, deforms, is instanced, or consists of curves or of a bilinear mesh that is not
// all parallelograms. Emissive cylinders, and partial or stretched spheres and disks, become
// triangles, with a warning.
absl::StatusOr<BakedScene> BakeScene(SceneDescription* scene, EmissionMaps maps = {});

}  // namespace sheaf::render
