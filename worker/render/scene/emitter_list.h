// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmitterList: emissive shapes as the light table wants them, and the ids by which hits name them.
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
  // maps: the pictures of scene.area_lights. scene must outlive *this.
  EmitterList(const SceneDescription& scene, EmissionMaps maps) : scene_(scene) {
    input_.maps = std::move(maps);
  }

  // light: index of the shape's light. Return a preliminary id for Surface::emitter, or kNoEmitter
  // where the light is black; AssignIds makes it final. flips: whether the shape faces inwards
  // (spheres) or along -z (disks). A mesh that emits a picture of much contrast is a grid of
  // emitters for each of its triangles, so that the choice of lights knows its bright parts:
  // AddMesh sets how fine in the mesh's surface.
  uint32_t AddMesh(int32_t light, BakedMesh* mesh);
  uint32_t AddQuadric(const Quadric& quadric, const Surface& surface, int32_t light);
  // Whether the light table has a sampling of the quadric's own: whole spheres scaled alike along
  // all axes, and round disks that go all the way about.
  static bool IsSampled(const Quadric& quadric);

  // Ids in the light table count triangles first, then spheres, then disks. Call once, after all.
  void AssignIds(GeometryGroup* world) const;
  LightTableInput Take();

 private:
  // What a shape of the given area emits; of a picture, its mean.
  Emission EmissionOf(int32_t light, double area) const;
  const AreaLightDescription& LightAt(int32_t light) const {
    return scene_.area_lights[static_cast<size_t>(light)];
  }
  // Null where the light has none.
  const EmissionMap* MapOf(int32_t light) const;
  // Of a shape; nothing where its emission does not vary.
  std::optional<EmissionDetail> DetailOf(const Surface& surface, int32_t light,
                                         const Emission& mean) const;
  bool IsAlwaysCutOut(const Surface& surface) const;
  // The emitter of one face, or of each cell of it.
  void AddFace(const BakedMesh& mesh, const uint32_t* indices, TriangleEmitter emitter,
               const EmissionDetail* detail);

  const SceneDescription& scene_;
  LightTableInput input_;
  // By kind, in the order of the emitters; shorter where the last ones have none.
  std::vector<int32_t> triangle_details_, sphere_details_, disk_details_;
};

}  // namespace sheaf::render
