// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneIds: numbers and names for the ids of a scene's surfaces (IdKind). The file format names
// only object definitions and materials, so other items are named by their location in the scene:
//
//   object    "scene.pbrt:12:1" for a shape of the world; "tree#3" for the third instance of "tree"
//   material  its name, or the place of an unnamed one
//   asset     the object definition for an instance; else the file that contains the shape
//
// The order in the scene determines the numbers, so all workers agree.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "common/scene/scene_description.h"
#include "worker/render/geometry/surface_point.h"

namespace sheaf::render {

class SceneIds {
 public:
  SceneIds() = default;
  // Errors: kResourceExhausted where the scene has more items of a kind than kIdMax.
  static absl::StatusOr<SceneIds> Make(const SceneDescription& scene,
                                       const SceneGeometry& geometry);

  // kNoId where the surface has no material.
  uint32_t IdOf(IdKind kind, const SurfacePoint& point) const;
  // Requires: IdOf returned the id; scene is that of Make.
  std::string NameOf(IdKind kind, uint32_t id, const SceneDescription& scene) const;
  // Fills in the names of all ids in the tile's sums.
  void NameAll(const SceneDescription& scene, FilmTile* tile) const;

 private:
  // By PrimitiveId::placed: index of the instance, or kNone for a moving shape of the world.
  std::vector<int32_t> instance_of_placed_;
  std::vector<uint32_t> ordinal_of_instance_;  // From 1, among instances of the same object.
  std::vector<int32_t> object_of_instance_;
  std::vector<int32_t> file_of_shape_;
  uint32_t shape_count_ = 0, file_count_ = 0;
};

}  // namespace sheaf::render
