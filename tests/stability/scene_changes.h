// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Changes of a scene that keep its image: where it is, how it is turned and scaled, how often and
// in which order its shapes are given.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/math/transform.h"
#include "common/scene/scene_description.h"
#include "gtest/gtest.h"

namespace sheaf::render {

inline void MoveBy(const Matrix4& change, TransformOverTime* transform) {
  transform->start = change * transform->start;
  transform->end = change * transform->end;
}

// Transforms the whole scene. Media become thinner where lengths grow. Lights without an area are
// not scaled, so scenes with one at a place take scale 1.
inline void TransformAll(const Matrix4& change, SceneDescription* scene) {
  MoveBy(change, &scene->camera.world_from_camera);
  for (ShapeDescription& shape : scene->shapes) MoveBy(change, &shape.world_from_object);
  for (ObjectInstance& instance : scene->instances) MoveBy(change, &instance.world_from_instance);
  for (LightDescription& light : scene->lights) {
    light.world_from_light = change * light.world_from_light;
  }
  const double scale = std::cbrt(std::fabs(Determinant3(change)));
  for (MediumDescription& medium : scene->media) {
    medium.world_from_medium = change * medium.world_from_medium;
    medium.scale = static_cast<float>(medium.scale / scale);
  }
  Matrix4 back;
  EXPECT_TRUE(Invert(change, &back));
  for (TextureDescription& texture : scene->textures) {
    auto* image = std::get_if<ImageTexture>(&texture.texture);
    auto* checks = std::get_if<CheckerboardTexture>(&texture.texture);
    UvMapping* mapping = image != nullptr ? &image->mapping : nullptr;
    if (checks != nullptr) mapping = &checks->mapping;
    if (mapping != nullptr) mapping->texture_from_world = mapping->texture_from_world * back;
    if (auto* noise = std::get_if<NoiseTexture>(&texture.texture)) {
      noise->texture_from_world = noise->texture_from_world * back;
    }
    auto* node = std::get_if<NodeTexture>(&texture.texture);
    if (node != nullptr && !node->from_uv) {
      node->texture_from_place = node->texture_from_place * back;
    }
  }
}

// Every shape of the world twice.
inline void DoubleShapes(SceneDescription* scene) {
  const std::vector<int32_t> shapes = scene->world_shapes;
  for (const int32_t index : shapes) {
    scene->world_shapes.push_back(static_cast<int32_t>(scene->shapes.size()));
    const ShapeDescription copy = scene->shapes[static_cast<size_t>(index)];
    scene->shapes.push_back(copy);
  }
}

inline void ReverseShapes(SceneDescription* scene) {
  std::reverse(scene->world_shapes.begin(), scene->world_shapes.end());
}

// Divides each triangle into four.
inline void DivideTriangles(SceneDescription* scene) {
  for (TriangleMesh& mesh : scene->meshes) {
    if (!mesh.normals.empty() || !mesh.uvs.empty()) continue;
    std::vector<uint32_t> divided;
    for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
      const uint32_t a = mesh.indices[i], b = mesh.indices[i + 1], c = mesh.indices[i + 2];
      const auto middle = [&](uint32_t from, uint32_t to) {
        mesh.positions.push_back((mesh.positions[from] + mesh.positions[to]) * 0.5f);
        return static_cast<uint32_t>(mesh.positions.size() - 1);
      };
      const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      divided.insert(divided.end(), {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca});
    }
    mesh.indices = std::move(divided);
  }
}

struct Change {
  std::string name;
  std::function<void(SceneDescription*)> apply;
  bool scales = false;  // Lengths change.
};
inline Change Whole(std::string name, const Matrix4& matrix) {
  const bool scales = std::fabs(std::fabs(Determinant3(matrix)) - 1) > 1e-6;
  return {std::move(name), [matrix](SceneDescription* scene) { TransformAll(matrix, scene); },
          scales};
}
inline Matrix4 Scaled(double x, double y, double z) { return ScaleMatrix({x, y, z}); }

inline std::vector<Change> ImageKeepingChanges() {
  const Matrix4 odd = RotateMatrix(37.3, {0.3, 0.7, -0.4});
  return {
      Whole("turned by 37 degrees", odd),
      Whole("turned by 90 degrees", RotateMatrix(90, {0, 0, 1})),
      Whole("turned twice", RotateMatrix(181, {1, -0.2, 0.1}) * odd),
      Whole("mirrored", Scaled(-1, 1, 1)),
      Whole("mirrored three times and turned", Scaled(-1, -1, -1) * odd),
      Whole("scaled by 1e-5", Scaled(1e-5, 1e-5, 1e-5)),
      Whole("scaled by .37", Scaled(0.37, 0.37, 0.37)),
      Whole("scaled by 1e5 and turned", Scaled(1e5, 1e5, 1e5) * odd),
      Whole("moved", TranslateMatrix({6, -5, 4})),
      Whole("moved by 1e6 sizes", TranslateMatrix({6e6, 4e6, -5e6})),
      {"given twice", DoubleShapes},
      {"given twice and turned",
       [odd](SceneDescription* scene) {
         TransformAll(odd, scene);
         DoubleShapes(scene);
       }},
      {"reversed", ReverseShapes},
      {"with finer triangles and turned",
       [odd](SceneDescription* scene) {
         TransformAll(odd, scene);
         DivideTriangles(scene);
       }},
      {"given twice, once with finer triangles, and turned",
       [odd](SceneDescription* scene) {
         TransformAll(odd, scene);
         const size_t meshes = scene->meshes.size(), shapes = scene->shapes.size();
         SceneDescription finer = *scene;
         DivideTriangles(&finer);
         scene->meshes.insert(scene->meshes.end(), finer.meshes.begin(), finer.meshes.end());
         DoubleShapes(scene);
         for (size_t i = shapes; i < scene->shapes.size(); ++i) {
           auto* mesh = std::get_if<MeshShape>(&scene->shapes[i].shape);
           if (mesh != nullptr) mesh->mesh += static_cast<int32_t>(meshes);
         }
       }},
  };
}

}  // namespace sheaf::render
