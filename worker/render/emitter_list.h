// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmitterList: emissive shapes as the light table wants them, and the ids by which hits name them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "worker/render/light_table.h"
#include "worker/render/quadric.h"
#include "worker/render/scene_geometry.h"

namespace sheaf::render {

class EmitterList {
 public:
  // lights: the scene's; must outlive *this.
  explicit EmitterList(const std::vector<AreaLightDescription>& lights) : lights_(lights) {}

  // light: index of the shape's light. Return a preliminary id for Surface::emitter, or kNoEmitter
  // where the light is black; AssignIds makes it final. flips: whether the shape faces inwards
  // (spheres) or along -z (disks).
  uint32_t AddMesh(const BakedMesh& mesh, int32_t light);
  uint32_t AddQuadric(const Quadric& quadric, bool flips, int32_t light);
  // Why the quadric cannot be an area light; empty where it can.
  static std::string ProblemWith(const Quadric& quadric);

  // Ids in the light table count triangles first, then spheres, then disks. Call once, after all.
  void AssignIds(GeometryGroup* world) const;
  LightTableInput Take() { return std::move(input_); }

 private:
  // What a shape of the given area emits.
  Emission EmissionOf(int32_t light, double area) const;

  const std::vector<AreaLightDescription>& lights_;
  LightTableInput input_;
};

}  // namespace sheaf::render
