// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// NodeTree: the hierarchy of nodes with the transformation of each (glTF 2.0 specification, sec.
// 3.5), without recursion: a file may nest nodes as deep as it has nodes.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <optional>
#include <vector>

#include "common/math/transform.h"
#include "common/scene/pbrt/syntax/diagnostics.h"

namespace sheaf::gltf {

struct Quaternion {
  double x = 0, y = 0, z = 0, w = 1;
};
// Shortest way between unit quaternions at constant speed; t in [0, 1].
Quaternion Slerp(Quaternion a, Quaternion b, double t);
Quaternion Normalized(Quaternion q);  // The identity in place of zero.
Matrix4 MatrixOf(Vec3d translation, Quaternion rotation, Vec3d scale);

// The state of a node at some time.
struct Pose {
  Vec3d translation{0, 0, 0}, scale{1, 1, 1};
  Quaternion rotation;
  std::optional<Matrix4> matrix;  // In place of the three.
  std::vector<double> weights;    // Weights of morph targets; empty: those of the mesh.
};

class NodeTree {
 public:
  // Reports errors: nodes that do not exist, with two parents, or within themselves; numbers that
  // are not finite or too large. model must outlive this.
  static std::optional<NodeTree> Make(const tinygltf::Model& model, Diagnostics* diagnostics);

  const std::vector<Pose>& poses() const { return poses_; }  // As the file has them, by node.
  // The nodes of the scene that the file shows, parents first.
  const std::vector<int>& shown() const { return shown_; }
  // World matrix of each node for poses of all nodes.
  std::vector<Matrix4> WorldMatrices(const std::vector<Pose>& poses) const;

 private:
  std::vector<Pose> poses_;
  std::vector<int> order_;   // All nodes, parents first.
  std::vector<int> parent_;  // -1: a root.
  std::vector<int> shown_;
};

}  // namespace sheaf::gltf
