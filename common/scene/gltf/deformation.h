// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Skins, and the form that they and morph targets give a primitive (glTF 2.0 specification, sec.
// 3.7.2.2 and 3.7.3).
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <map>
#include <string>
#include <vector>

#include "common/math/transform.h"
#include "common/scene/gltf/accessors.h"
#include "common/scene/gltf/meshes.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_description.h"

namespace sheaf::gltf {

// weights: of the morph targets; missing ones are 0. joints: for each joint of the skin the matrix
// from the mesh's space to the world; empty without a skin. Joints that do not exist move nothing.
VertexStep Deformed(const Primitive& primitive, const std::vector<double>& weights,
                    const std::vector<Matrix4>& joints);

// For each joint of a skin the matrix from the mesh's space to the world, when the shutter opens
// and when it closes; empty without a skin.
struct Joints {
  bool is_valid = true;
  std::vector<Matrix4> start, end;
};

class Skins {
 public:
  // All arguments must outlive this. world_start, world_end: by node, filled before the first Get.
  Skins(const tinygltf::Model* model, const std::vector<Matrix4>* world_start,
        const std::vector<Matrix4>* world_end, Accessors* accessors, Diagnostics* diagnostics)
      : model_(model),
        world_start_(world_start),
        world_end_(world_end),
        accessors_(accessors),
        diagnostics_(diagnostics) {}

  // Null after an error, which is reported. skin: -1 for none. what: the node.
  const Joints* Get(int skin, const std::string& what);

 private:
  bool Read(int index, const std::string& what, Joints* joints);

  const tinygltf::Model* model_;
  const std::vector<Matrix4>*world_start_, *world_end_;
  Accessors* accessors_;
  Diagnostics* diagnostics_;
  std::map<int, Joints> known_;
};

}  // namespace sheaf::gltf
