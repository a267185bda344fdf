// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/node_tree.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

// Beyond this, products of a few transformations overflow.
constexpr double kMagnitudeMax = 1e30;

bool AllFinite(const std::vector<double>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(),
                     [](double x) { return std::fabs(x) <= kMagnitudeMax; });
}

Vec3d VectorOf(const std::vector<double>& numbers, Vec3d fallback) {
  return numbers.size() == 3 ? Vec3d{numbers[0], numbers[1], numbers[2]} : fallback;
}

Pose PoseOf(const tinygltf::Node& node) {
  Pose pose;
  pose.translation = VectorOf(node.translation, {0, 0, 0});
  pose.scale = VectorOf(node.scale, {1, 1, 1});
  if (node.rotation.size() == 4) {
    pose.rotation =
        Normalized({node.rotation[0], node.rotation[1], node.rotation[2], node.rotation[3]});
  }
  if (node.matrix.size() == 16) {
    Matrix4 matrix;  // The file has columns.
    for (size_t row = 0; row < 4; ++row) {
      for (size_t column = 0; column < 4; ++column) {
        matrix.m[row][column] = node.matrix[4 * column + row];
      }
    }
    pose.matrix = matrix;
  }
  pose.weights = node.weights;
  return pose;
}

}  // namespace

Quaternion Normalized(Quaternion q) {
  const double length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  if (!(length > 0) || !std::isfinite(length)) return {};
  return {q.x / length, q.y / length, q.z / length, q.w / length};
}

Quaternion Slerp(Quaternion a, Quaternion b, double t) {
  double cosine = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
  if (cosine < 0) {  // q and -q are the same rotation.
    cosine = -cosine;
    b = {-b.x, -b.y, -b.z, -b.w};
  }
  double from = 1 - t, to = t;
  // Nearly equal rotations: the line is as good, and has no division by 0.
  constexpr double kCosineMax = 1 - 1e-9;
  if (cosine < kCosineMax) {
    const double angle = std::acos(cosine), sine = std::sin(angle);
    from = std::sin((1 - t) * angle) / sine;
    to = std::sin(t * angle) / sine;
  }
  return Normalized(
      {from * a.x + to * b.x, from * a.y + to * b.y, from * a.z + to * b.z, from * a.w + to * b.w});
}

Matrix4 MatrixOf(Vec3d translation, Quaternion q, Vec3d scale) {
  Matrix4 r;
  r.m[0] = {1 - 2 * (q.y * q.y + q.z * q.z), 2 * (q.x * q.y - q.z * q.w),
            2 * (q.x * q.z + q.y * q.w), 0};
  r.m[1] = {2 * (q.x * q.y + q.z * q.w), 1 - 2 * (q.x * q.x + q.z * q.z),
            2 * (q.y * q.z - q.x * q.w), 0};
  r.m[2] = {2 * (q.x * q.z - q.y * q.w), 2 * (q.y * q.z + q.x * q.w),
            1 - 2 * (q.x * q.x + q.y * q.y), 0};
  return TranslateMatrix(translation) * r * ScaleMatrix(scale);
}

std::optional<NodeTree> NodeTree::Make(const tinygltf::Model& model, Diagnostics* diagnostics) {
  const size_t count = model.nodes.size();
  NodeTree tree;
  tree.parent_.assign(count, -1);
  const auto fail = [&](int node, const std::string& problem) {
    const std::string name =
        HasIndex(model.nodes, node) ? model.nodes[static_cast<size_t>(node)].name : "";
    diagnostics->Error(
        kFile, absl::StrCat(Named("node", node, name), " ", problem, "; export the file again"));
    return std::nullopt;
  };
  for (size_t n = 0; n < count; ++n) {
    const tinygltf::Node& node = model.nodes[n];
    if (!AllFinite(node.translation) || !AllFinite(node.rotation) || !AllFinite(node.scale) ||
        !AllFinite(node.matrix) || !AllFinite(node.weights)) {
      return fail(static_cast<int>(n), "has a number that is too large or none");
    }
    tree.poses_.push_back(PoseOf(node));
    for (const int child : node.children) {
      if (!HasIndex(model.nodes, child)) {
        return fail(static_cast<int>(n),
                    absl::StrCat("has the child ", child, ", which does not exist"));
      }
      int& parent = tree.parent_[static_cast<size_t>(child)];
      if (parent >= 0) return fail(child, "is a child of two nodes");
      parent = static_cast<int>(n);
    }
  }
  for (size_t n = 0; n < count; ++n) {
    if (tree.parent_[n] < 0) tree.order_.push_back(static_cast<int>(n));
  }
  for (size_t i = 0; i < tree.order_.size(); ++i) {
    const std::vector<int>& children = model.nodes[static_cast<size_t>(tree.order_[i])].children;
    for (const int child : children) tree.order_.push_back(child);
  }
  if (tree.order_.size() < count) {
    std::vector<bool> reached(count);
    for (const int n : tree.order_) reached[static_cast<size_t>(n)] = true;
    const auto lost = std::find(reached.begin(), reached.end(), false);
    return fail(static_cast<int>(lost - reached.begin()), "lies within itself");
  }
  // Without a scene, all nodes are shown.
  std::vector<bool> shown(count, model.scenes.empty());
  if (!model.scenes.empty()) {
    const int scene = model.defaultScene < 0 ? 0 : model.defaultScene;
    if (!HasIndex(model.scenes, scene)) {
      diagnostics->Error(kFile, absl::StrCat("scene ", scene, " does not exist; export it again"));
      return std::nullopt;
    }
    for (const int root : model.scenes[static_cast<size_t>(scene)].nodes) {
      if (!HasIndex(model.nodes, root)) return fail(root, "of the scene does not exist");
      shown[static_cast<size_t>(root)] = true;
    }
  }
  for (const int n : tree.order_) {
    const int parent = tree.parent_[static_cast<size_t>(n)];
    if (parent >= 0 && shown[static_cast<size_t>(parent)]) shown[static_cast<size_t>(n)] = true;
    if (shown[static_cast<size_t>(n)]) tree.shown_.push_back(n);
  }
  return tree;
}

std::vector<Matrix4> NodeTree::WorldMatrices(const std::vector<Pose>& poses) const {
  std::vector<Matrix4> world(poses.size());
  for (const int n : order_) {
    const Pose& pose = poses[static_cast<size_t>(n)];
    const Matrix4 local =
        pose.matrix ? *pose.matrix : MatrixOf(pose.translation, pose.rotation, pose.scale);
    const int parent = parent_[static_cast<size_t>(n)];
    world[static_cast<size_t>(n)] = parent < 0 ? local : world[static_cast<size_t>(parent)] * local;
  }
  return world;
}

}  // namespace sheaf::gltf
