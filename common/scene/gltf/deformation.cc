// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/deformation.h"

#include <cmath>

namespace sheaf::gltf {
namespace {

Vec3f UnitOr(Vec3d n, Vec3f fallback) {
  const double length = Length(n);
  return length > 0 && std::isfinite(length) ? ToFloat(n / length) : fallback;
}

void Morph(const Primitive& primitive, const std::vector<double>& weights, VertexStep* step) {
  for (size_t t = 0; t < primitive.targets.size() && t < weights.size(); ++t) {
    const Primitive::Target& target = primitive.targets[t];
    const auto weight = static_cast<float>(weights[t]);
    if (weight == 0) continue;
    for (size_t v = 0; v < target.positions.size(); ++v) {
      step->positions[v] += weight * target.positions[v];
    }
    for (size_t v = 0; v < target.normals.size(); ++v) {
      step->normals[v] += weight * target.normals[v];
    }
  }
}

// The mean of the joints' matrices, by weight.
Matrix4 BlendOf(const Primitive& primitive, size_t vertex, const std::vector<Matrix4>& joints) {
  Matrix4 blend;
  for (auto& row : blend.m) row.fill(0);
  double sum = 0;
  for (size_t k = 0; k < primitive.influences; ++k) {
    const size_t at = vertex * primitive.influences + k;
    const auto weight = static_cast<double>(primitive.weights[at]);
    if (weight == 0 || primitive.joints[at] >= joints.size()) continue;
    const Matrix4& joint = joints[primitive.joints[at]];
    for (size_t r = 0; r < 4; ++r) {
      for (size_t c = 0; c < 4; ++c) blend.m[r][c] += weight * joint.m[r][c];
    }
    sum += weight;
  }
  if (!(sum > 0)) return {};
  for (auto& row : blend.m) {
    for (double& x : row) x /= sum;
  }
  return blend;
}

}  // namespace

VertexStep Deformed(const Primitive& primitive, const std::vector<double>& weights,
                    const std::vector<Matrix4>& joints) {
  VertexStep step{primitive.mesh.positions, primitive.mesh.normals};
  Morph(primitive, weights, &step);
  if (joints.empty() || primitive.influences == 0) return step;
  for (size_t v = 0; v < step.positions.size(); ++v) {
    const Matrix4 blend = BlendOf(primitive, v, joints);
    step.positions[v] = ToFloat(TransformPoint(blend, ToDouble(step.positions[v])));
    if (step.normals.empty()) continue;
    Matrix4 inverse;
    if (!Invert(blend, &inverse)) continue;
    step.normals[v] = UnitOr(TransformNormal(inverse, ToDouble(step.normals[v])), step.normals[v]);
  }
  return step;
}

}  // namespace sheaf::gltf
