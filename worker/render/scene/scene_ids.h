// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneIds: numbers and names for the ids of a scene's surfaces (IdKind):
//
//   object    a shape of the world, or an instance (matte_names.h)
//   material  its name (matte_names.h)
//   asset     the object definition for an instance; else the included file that contains the
//             shape, or "scene" for the main one, whose name differs from frame to frame
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
#include "worker/render/scene/matte_names.h"

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
  std::vector<int32_t> object_of_instance_;
  std::vector<int32_t> file_of_shape_;
  uint32_t shape_count_ = 0, file_count_ = 0;
  MatteNames names_;
};

}  // namespace sheaf::render
