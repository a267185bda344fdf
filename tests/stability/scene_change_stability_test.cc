// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of whole scenes, named as in the catalogue (G19): turned, mirrored, scaled, moved,
// given twice, in reverse order or with finer triangles, a scene has the same image, by each
// technique.
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/long_tests.h"
#include "tests/support/technique_scenes.h"

namespace sheaf::render {
namespace {

constexpr int32_t kPixels = 16, kBlock = 8;

// --- Changes that leave the image as it is
// --------------------------------------------------------

void MoveBy(const Matrix4& change, TransformOverTime* transform) {
  transform->start = change * transform->start;
  transform->end = change * transform->end;
}

// Transforms the whole scene; scale: the factor of its lengths. Media and light sources without an
// area are not scaled, so scenes with them take scale 1.
void TransformAll(const Matrix4& change, SceneDescription* scene) {
  MoveBy(change, &scene->camera.world_from_camera);
  for (ShapeDescription& shape : scene->shapes) MoveBy(change, &shape.world_from_object);
  for (ObjectInstance& instance : scene->instances) MoveBy(change, &instance.world_from_instance);
  for (LightDescription& light : scene->lights) {
    light.world_from_light = change * light.world_from_light;
  }
}

// Every shape of the world twice.
void DoubleShapes(SceneDescription* scene) {
  const std::vector<int32_t> shapes = scene->world_shapes;
  for (const int32_t index : shapes) {
    scene->world_shapes.push_back(static_cast<int32_t>(scene->shapes.size()));
    const ShapeDescription copy = scene->shapes[static_cast<size_t>(index)];
    scene->shapes.push_back(copy);
  }
}

void ReverseShapes(SceneDescription* scene) {
  std::reverse(scene->world_shapes.begin(), scene->world_shapes.end());
}

// Divides each triangle into four.
void DivideTriangles(SceneDescription* scene) {
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
};
Change Whole(std::string name, const Matrix4& matrix) {
  return {std::move(name), [matrix](SceneDescription* scene) { TransformAll(matrix, scene); }};
}
Matrix4 Scaled(double x, double y, double z) { return ScaleMatrix({x, y, z}); }

std::vector<Change> ImageKeepingChanges() {
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

// A table with a glass on it, below a ceiling with a lamp in its plane, in front of a wall with a
// decal.
TestScene FlushRoom() {
  TestScene t({0, 1, -3.2}, {0, 0.6, 0}, 36);
  t.AddShape(MeshShape{t.Quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2})},
             t.Diffuse({0.6f, 0.5f, 0.4f}));
  t.AddShape(MeshShape{t.Quad({-2, 0, 2}, {-2, 3, 2}, {2, 3, 2}, {2, 0, 2})},
             t.Diffuse({0.3f, 0.5f, 0.7f}));
  t.AddShape(
      MeshShape{t.Quad({-0.9f, 0.3f, 2}, {-0.9f, 1.6f, 2}, {0.4f, 1.6f, 2}, {0.4f, 0.3f, 2})},
      t.Diffuse({0.8f, 0.2f, 0.1f}));
  t.AddShape(MeshShape{t.Quad({-2, 2.5f, -2}, {2, 2.5f, -2}, {2, 2.5f, 2}, {-2, 2.5f, 2})},
             t.Diffuse({0.7f, 0.7f, 0.7f}));
  AddPointEmitter(&t, {1}, 0.9f);
  DielectricMaterial glass;
  glass.eta.mean = 1.5f;
  t.AddShape(MeshShape{t.Box({0.1f, 0, -0.4f}, {0.8f, 0.7f, 0.3f})}, t.AddMaterial(glass));
  return t;
}

struct ChangedScene {
  std::string name;
  TestScene scene;
  std::vector<TechniqueSet> techniques;
};

std::vector<size_t> BlockOf(int32_t index) {
  std::vector<size_t> pixels;
  const int32_t across = kPixels / kBlock;
  for (int32_t y = 0; y < kBlock; ++y) {
    for (int32_t x = 0; x < kBlock; ++x) {
      const int32_t row = index / across * kBlock + y, column = index % across * kBlock + x;
      pixels.push_back(static_cast<size_t>(row * kPixels + column));
    }
  }
  return pixels;
}

BothFilms RenderChanged(const SceneDescription& scene, TechniqueSet techniques) {
  FrameSettings settings = SquareSettings(kPixels, DrawCount(32, 512), 8);
  settings.techniques = techniques;
  return RenderBothFilms(*Compile(scene, settings));
}

// G19: the image of a scene does not depend on where it is, how it is turned or written.
TEST(SceneChangeStability, G19ChangedScenesKeepTheirImage) {
  const std::vector<TechniqueSet> all{TechniqueSet::kCamera, TechniqueSet::kLight,
                                      TechniqueSet::kCameraAndLight};
  const std::vector<ChangedScene> cases{
      {"diffuse", Diffuse({1}), all},
      {"glossy", Glossy({1}), {TechniqueSet::kCamera, TechniqueSet::kCameraAndLight}},
      {"closed room", LitRoom(1), all},
      {"flush room", FlushRoom(), {TechniqueSet::kCamera, TechniqueSet::kCameraAndLight}},
  };
  double largest = 0;
  for (const ChangedScene& of : cases) {
    SCOPED_TRACE(of.name);
    for (const TechniqueSet techniques : of.techniques) {
      SCOPED_TRACE(techniques.Name());
      const BothFilms plain = RenderChanged(of.scene.scene, techniques);
      for (const Change& change : ImageKeepingChanges()) {
        SCOPED_TRACE(change.name);
        SceneDescription scene = of.scene.scene;
        change.apply(&scene);
        const BothFilms changed = RenderChanged(scene, techniques);
        for (int32_t block = 0; block < 4; ++block) {
          const ComponentMean expected = MeanOverPixels(plain, 1, BlockOf(block)),
                              measured = MeanOverPixels(changed, 1, BlockOf(block));
          const double error = std::hypot(expected.standard_error, measured.standard_error);
          EXPECT_NEAR(measured.value, expected.value, 5 * error + 0.01 * expected.value);
          largest = std::max(largest, std::fabs(measured.value - expected.value) / expected.value -
                                          5 * error / expected.value);
        }
      }
    }
  }
  ExpectHardCase({.row = "G19",
                  .figure = "largest relative change of a block of the image, beyond its error",
                  .expected = 0,
                  .measured = std::max(0.0, largest),
                  .tolerance = 0.01});
}

}  // namespace
}  // namespace sheaf::render
