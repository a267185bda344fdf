// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/deformation.h"

#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/scene/gltf/values.h"

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

const Joints* Skins::Get(int skin, const std::string& what) {
  const auto [entry, is_new] = known_.try_emplace(skin);
  if (is_new && skin >= 0) entry->second.is_valid = Read(skin, what, &entry->second);
  return entry->second.is_valid ? &entry->second : nullptr;
}

bool Skins::Read(int index, const std::string& what, Joints* joints) {
  if (!HasIndex(model_->skins, index)) {
    diagnostics_->Error(kFile, absl::StrCat(what, " has the skin ", index,
                                            ", which does not exist; export the file again"));
    return false;
  }
  const tinygltf::Skin& skin = model_->skins[static_cast<size_t>(index)];
  if (!accessors_->Charge(2 * skin.joints.size() * sizeof(Matrix4))) return false;
  std::vector<float> inverse;
  if (skin.inverseBindMatrices >= 0) {
    auto read = accessors_->Floats(skin.inverseBindMatrices, 16,
                                   Named("skin", index, skin.name) + ", inverse bind matrices");
    if (!read) return false;
    inverse = *std::move(read);
  }
  for (size_t j = 0; j < skin.joints.size(); ++j) {
    if (!HasIndex(model_->nodes, skin.joints[j]) ||
        (!inverse.empty() && inverse.size() < 16 * (j + 1))) {
      diagnostics_->Error(kFile, absl::StrCat(Named("skin", index, skin.name), " has the joint ", j,
                                              " without node or matrix; export it again"));
      return false;
    }
    Matrix4 bind;
    for (size_t k = 0; k < 16 && !inverse.empty(); ++k) {
      bind.m[k % 4][k / 4] = static_cast<double>(inverse[16 * j + k]);
    }
    joints->start.push_back((*world_start_)[static_cast<size_t>(skin.joints[j])] * bind);
    joints->end.push_back((*world_end_)[static_cast<size_t>(skin.joints[j])] * bind);
  }
  return true;
}

}  // namespace sheaf::gltf
