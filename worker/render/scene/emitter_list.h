// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmitterList: collects emissive shapes as input of the light table, and assigns their emitter ids.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "worker/render/geometry/quadric.h"
#include "worker/render/geometry/scene_geometry.h"
#include "worker/render/light/light_table.h"

namespace sheaf::render {

class EmitterList {
 public:
  // maps: the images of scene.area_lights. scene must outlive *this.
  EmitterList(const SceneDescription& scene, EmissionMaps maps) : scene_(scene) {
    input_.maps = std::move(maps);
  }

  // light: index of the shape's light. Return a preliminary id for Surface::emitter, or kNoEmitter
  // where the light is black; AssignIds makes it final. surface.flips_normal: whether the shape
  // faces inwards (spheres) or along -z (disks). A mesh that emits an image of high contrast
  // becomes a grid of emitters per triangle, so that light selection can resolve its bright parts;
  // AddMesh stores the grid's resolution in the mesh's surface.
  uint32_t AddMesh(int32_t light, BakedMesh* mesh);
  uint32_t AddQuadric(const Quadric& quadric, const Surface& surface, int32_t light);
  // Whether the light table samples the quadric directly: full spheres of uniform scale, and round
  // disks of a full turn.
  static bool IsSampled(const Quadric& quadric);

  // Ids in the light table count triangles, then spheres, then disks. Call once, after all Add
  // calls.
  void AssignIds(GeometryGroup* world) const;
  LightTableInput Take();

 private:
  // The emission of a shape of the given area; for an image, its mean.
  Emission EmissionOf(int32_t light, double area) const;
  const AreaLightDescription& LightAt(int32_t light) const {
    return scene_.area_lights[static_cast<size_t>(light)];
  }
  // Null where the light has no image.
  const EmissionMap* MapOf(int32_t light) const;
  // Detail of a shape; none where its emission is constant.
  std::optional<EmissionDetail> DetailOf(const Surface& surface, int32_t light,
                                         const Emission& mean) const;
  bool IsAlwaysCutOut(const Surface& surface) const;
  // Adds the emitter of one face, or of each of its cells.
  void AddFace(const BakedMesh& mesh, const uint32_t* indices, TriangleEmitter emitter,
               const EmissionDetail* detail);

  const SceneDescription& scene_;
  LightTableInput input_;
  // By kind, in the order of the emitters; shorter where the last emitters have no details.
  std::vector<int32_t> triangle_details_, sphere_details_, disk_details_;
};

}  // namespace sheaf::render
