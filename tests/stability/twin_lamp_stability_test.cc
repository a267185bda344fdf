// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of lamps that a scene gives twice (G17): they shine as one, by every technique.
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/test_scene.h"
#include "worker/render/scene/twin_emitters.h"

namespace sheaf::render {
namespace {

// Renders a floor under `count` lamps, which add(scene, i) adds. Expects the means of one and two.
void ExpectOneLampOfTwo(const std::function<void(TestScene*, int)>& add, uint32_t max_depth,
                        const std::string& name) {
  const auto render = [&](int count, TechniqueSet techniques) {
    TestScene t({0, 3, -6}, {0, 0, 0}, 30);
    t.AddShape(MeshShape{t.Quad({-4, 0, -4}, {-4, 0, 4}, {4, 0, 4}, {4, 0, -4})},
               t.Diffuse(Rgb::Gray(0.5f)));
    for (int i = 0; i < count; ++i) add(&t, i);
    FrameSettings settings = SquareSettings(12, 256, max_depth);
    settings.techniques = techniques;
    return MeanOverPixels(RenderBothFilms(*Compile(t.scene, settings)), 0);
  };
  for (const TechniqueSet techniques :
       {TechniqueSet::kCamera, TechniqueSet::kLight, TechniqueSet::kCameraAndLight}) {
    const ComponentMean once = render(1, techniques), twice = render(2, techniques);
    EXPECT_NEAR(twice.value, once.value,
                5 * std::hypot(once.standard_error, twice.standard_error) + 0.005 * once.value)
        << name;
    EXPECT_GT(once.value, 0) << name;
  }
}

// The points of a round lamp are off by the rounding of coordinates, about which the normal of a
// small one turns. The second is turned, so that the two are not equal numbers.
TEST(ContactStability, G17RoundLampsGivenTwiceAreOne) {
  for (const float radius : {0.01f, 0.06f, 1.0f}) {
    ExpectOneLampOfTwo(
        [radius](TestScene* t, int i) {
          t->AddShape(SphereShape{radius, -radius, radius, 360}, t->Diffuse({}),
                      TranslateMatrix({2.2, 4.5, -1}) * RotateMatrix(30.0 * i, {0, 1, 0}))
              .area_light = t->AreaLight(Rgb::Gray(9));
        },
        2, "radius " + std::to_string(radius));
  }
}

// The light of a lamp of glass passes through its twin: by what the first lets through, the pair
// would be brighter than one.
TEST(ContactStability, G17GlassLampsGivenTwiceAreOne) {
  const auto add_lamp = [](TestScene* t, const auto& shape, int32_t material,
                           const Matrix4& place) {
    t->AddShape(shape, material, place).area_light = t->AreaLight(Rgb::Gray(9));
  };
  const auto material = [](TestScene* t, int i, bool is_interface) {
    if (i > 0) return static_cast<int32_t>(t->scene.materials.size()) - 1;
    if (is_interface) return t->AddMaterial(InterfaceMaterial{});
    DielectricMaterial glass;
    glass.eta.mean = 1.5f;
    glass.roughness.u.value = glass.roughness.v.value = 0.5f;
    return t->AddMaterial(glass);
  };
  for (const bool is_interface : {false, true}) {
    const std::string name = is_interface ? "interface" : "glass";
    ExpectOneLampOfTwo(
        [&](TestScene* t, int i) {
          add_lamp(t, SphereShape{0.5f, -0.5f, 0.5f, 360}, material(t, i, is_interface),
                   TranslateMatrix({2.2, 4.5, -1}));
        },
        6, name + " ball");
    ExpectOneLampOfTwo(
        [&](TestScene* t, int i) {
          const int32_t mesh = t->Quad({1, 4, 0}, {2, 4, 0}, {2, 4, 1}, {1, 4, 1});
          add_lamp(t, MeshShape{mesh}, material(t, i, is_interface), Matrix4{});
        },
        6, name + " square");
  }
}

// Only shapes that are equal in all that the image shows are twins.
TEST(ContactStability, G17LampsThatDifferAreNotTwins) {
  const auto kept = [](const std::function<void(TestScene*, ShapeDescription*)>& change) {
    TestScene t({0, 3, -6}, {0, 0, 0}, 30);
    const int32_t material = t.Diffuse({});
    for (int i = 0; i < 2; ++i) {
      ShapeDescription& shape = t.AddShape(
          MeshShape{t.Quad({0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1})}, material, Matrix4{});
      shape.area_light = t.AreaLight(Rgb::Gray(9));
      if (i == 1) change(&t, &shape);
    }
    RemoveTwinEmitters(&t.scene);
    return t.scene.world_shapes.size();
  };
  EXPECT_EQ(kept([](TestScene*, ShapeDescription*) {}), 1u);
  EXPECT_EQ(kept([](TestScene* t, ShapeDescription* s) {
              const int32_t first = s->material;
              s->material = t->Diffuse({});
              for (const int32_t m : {first, s->material})
                t->scene.materials[m].first_alike = first;
            }),
            1u);
  const std::vector<std::function<void(TestScene*, ShapeDescription*)>> changes = {
      [](TestScene*, ShapeDescription* s) { s->reverse_orientation = true; },
      [](TestScene*, ShapeDescription* s) { s->area_light = kNone; },
      [](TestScene*, ShapeDescription* s) { s->media.inside = 0; },
      [](TestScene*, ShapeDescription* s) { s->alpha.value = 0.5f; },
      [](TestScene*, ShapeDescription* s) {
        s->world_from_object.start = TranslateMatrix({0, 0, 1e-9});
      },
      [](TestScene* t, ShapeDescription* s) { t->scene.area_lights[s->area_light].group = "b"; },
      [](TestScene* t, ShapeDescription* s) {
        t->scene.area_lights[s->area_light].radiance.rgb = Rgb::Gray(8);
      },
      [](TestScene* t, ShapeDescription* s) {
        t->scene.area_lights[s->area_light].two_sided = true;
      },
      [](TestScene* t, ShapeDescription* s) {
        t->scene.meshes[std::get<MeshShape>(s->shape).mesh].positions[2].x += 1e-6f;
      },
      [](TestScene* t, ShapeDescription* s) { s->material = t->Diffuse({}); },
  };
  for (size_t i = 0; i < changes.size(); ++i) EXPECT_EQ(kept(changes[i]), 2u) << "change " << i;
}

}  // namespace
}  // namespace sheaf::render
