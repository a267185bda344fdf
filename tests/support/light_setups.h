// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// One scene of lights for every kind of light, for tests of the rays that leave them. All lie
// within the sphere of radius kSetupRadius about the origin.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/math/transform.h"
#include "tests/support/light_tables.h"
#include "tests/support/temporary_path.h"
#include "worker/render/light/emission_map.h"
#include "worker/render/light/light_emission.h"
#include "worker/render/light/light_table.h"

namespace sheaf::render::testing {

inline constexpr double kSetupRadius = 4;

struct LightSetup {
  std::string name;
  std::unique_ptr<LightTable> table;
};

// Corners of a portal in the plane z = 1; light comes from above.
inline const Vec3d kPortalCorners[4] = {{-1, -0.5, 1}, {-1, 2, 1}, {0.5, 2, 1}, {0.5, -0.5, 1}};

// A map with strong contrast, a part of it black.
inline std::vector<Rgb> UnevenTexels(int size, uint64_t seed) {
  RandomPoints random(seed);
  std::vector<Rgb> texels(static_cast<size_t>(size) * static_cast<size_t>(size));
  for (Rgb& texel : texels) {
    const float bright = random.Next();
    const float value = bright < 0.25f ? 0 : bright * bright * bright;
    texel = {value, value * random.Next(), value * random.Next()};
  }
  return texels;
}

// Makes the tables; `scale` multiplies all lengths.
class LightSetups {
 public:
  explicit LightSetups(double scale = 1) : scale_(scale) {
    WritePfm(path_, 16, UnevenTexels(16, 5));
  }
  ~LightSetups() { std::filesystem::remove(path_); }
  LightSetups(const LightSetups&) = delete;
  LightSetups& operator=(const LightSetups&) = delete;

  std::vector<LightSetup> Surfaces() const {
    std::vector<LightSetup> setups;
    const auto add = [&](const char* name, LightTableInput input) {
      setups.push_back({name, MakeTable(std::move(input))});
    };
    for (const bool two_sided : {false, true}) {
      LightTableInput triangle, sphere, disk;
      triangle.triangles = {Triangle(two_sided)};
      sphere.spheres = {{At(0.1, 0.2, 1), scale_ * 0.4, kWhite, two_sided, false}};
      disk.disks = {Ring(0, two_sided)};
      add(two_sided ? "two-sided triangle" : "triangle", std::move(triangle));
      add(two_sided ? "two-sided sphere" : "sphere", std::move(sphere));
      add(two_sided ? "two-sided disk" : "disk", std::move(disk));
    }
    LightTableInput inward, ring;
    inward.spheres = {{At(0.1, 0.2, 0.3), scale_ * 2.5, kWhite, false, true}};
    ring.disks = {Ring(0.4, false)};
    add("inward sphere", std::move(inward));
    add("ring", std::move(ring));
    add("textured triangle", TexturedTriangle());
    return setups;
  }
  std::vector<LightSetup> Positions() const {
    std::vector<LightSetup> setups;
    const Matrix4 turned = TranslateMatrix(At(0.2, 0.1, 2)) * RotateMatrix(160, {1, 0.2, 0.1});
    const Matrix4 stretched = turned * ScaleMatrix({0.5, 2, 1.5});
    const auto add = [&](const std::string& name, const LightDescription& light) {
      setups.push_back({name, Build({light})});
    };
    add("point", MakePoint({2, 1, 1}, At(0.3, -0.2, 2)));
    add("spot", MakeSpot({2, 1, 1}, At(0.3, -0.2, 2), At(0, 0.1, 0), 40, 15));
    for (const bool is_stretched : {false, true}) {
      const std::string how = is_stretched ? "stretched " : "";
      LightDescription light = MakeSpot({2, 1, 1}, {0, 0, 0}, {0.1, 0, 1}, 35, 20);
      light.world_from_light = is_stretched ? stretched : turned;
      add(how + "turned spot", light);
      light.light = GoniometricLight{ColorOf({2, 1, 1}), "map.pfm", {}};
      add(how + "goniometric map", light);
      light.light = GoniometricLight{ColorOf({2, 1, 1}), "lamp.ies", Lamp()};
      add(how + "luminaire", light);
      light.light = ProjectionLight{"map.pfm", 70};
      add(how + "projection", light);
    }
    return setups;
  }
  std::vector<LightSetup> Infinite() const {
    std::vector<LightSetup> setups;
    setups.push_back({"distant", Build({MakeDistant({2, 1, 1}, {0.3, 0.2, 1})})});
    setups.push_back({"sky", Build({MakeSky({2, 1, 1})})});
    setups.push_back({"sky map", Build({Map(false)})});
    setups.push_back({"portal", Build({Map(true)})});
    setups.push_back({"two skies", Build({Map(true), Map(false)})});
    return setups;
  }
  // Lights of every kind at once.
  LightSetup Mixture() const {
    LightTableInput input = TexturedTriangle();
    input.spheres = {{At(0.9, 0.2, 1.2), scale_ * 0.2, Rgb{3, 1, 1}, false, false}};
    return {"mixture",
            Build({MakePoint({0.5f, 1, 1}, At(0.3, -0.2, 2)),
                   MakeSpot({2, 1, 1}, At(-0.3, -0.2, 2), At(0, 0.1, 0), 40, 15),
                   MakeDistant({0.1f, 1, 1}, {0.3, 0.2, 1}), MakeSky({0.05f, 1, 1}), Map(true)},
                  std::move(input))};
  }

  Vec3d At(double x, double y, double z) const { return Vec3d{x, y, z} * scale_; }
  TriangleEmitter Triangle(bool two_sided) const {
    return {ToFloat(At(-0.5, -0.5, 1.25)), ToFloat(At(0.25, 0.75, 1)),
            ToFloat(At(0.75, -0.25, 1.5)), kWhite, two_sided};
  }
  DiskEmitter Ring(double inner_radius, bool two_sided) const {
    return {At(0.1, 0.2, 1), {0.48, 0.6, -0.64}, {0.8, 0, 0.6}, scale_ * 0.6, scale_ * inner_radius,
            kWhite,          two_sided};
  }

 private:
  std::unique_ptr<LightTable> Build(std::vector<LightDescription> lights,
                                    LightTableInput input = {}) const {
    SceneDescription scene;
    scene.lights = std::move(lights);
    TableFileSource files({{"map.pfm", path_}});
    auto table = LightTable::Build(scene, std::move(input), files);
    SHEAF_CHECK(table.ok());
    return std::move(*table);
  }
  LightDescription Map(bool through_portal) const {
    InfiniteLight infinite;
    infinite.file = "map.pfm";
    if (through_portal) {
      for (const Vec3d& corner : kPortalCorners) infinite.portal.push_back(corner * scale_);
    }
    LightDescription light;
    light.light = infinite;
    light.world_from_light = RotateMatrix(30, {1, 2, 3});
    return light;
  }
  LightTableInput TexturedTriangle() const {
    LightTableInput input;
    input.triangles = {Triangle(false)};
    std::vector<Rgb> texels = UnevenTexels(4, 9);
    auto map = EmissionMap::Make(4, 4, std::move(texels));
    SHEAF_CHECK(map.ok());
    input.maps = {std::make_shared<const EmissionMap>(*std::move(map))};
    EmissionDetail detail;
    detail.map = 0;
    detail.map_scale = 3;
    detail.uv[0] = {0, 0};
    detail.uv[1] = {1, 0.1f};
    detail.uv[2] = {0.2f, 0.9f};
    input.details = {detail};
    input.detail_of = {0};
    return input;
  }
  // Three unequal planes; dark below 20 and above 110 degrees.
  static CandelaTable Lamp() {
    CandelaTable table;
    table.vertical_degrees = {20, 45, 60, 110};
    table.horizontal_degrees = {10, 100, 250};
    table.candelas = {0, 3, 1, 0, 2, 2, 0.5f, 0.25f, 0, 0, 0, 4};
    return table;
  }

  const double scale_;
  const std::string path_ = sheaf::testing::TemporaryPath("light_setups.pfm");
};

inline LightEmission EmissionOf(const LightSetup& setup) {
  return LightEmission(*setup.table, {0, 0, 0}, kSetupRadius);
}

inline EmissionUniforms NextUniforms(RandomPoints* random) {
  EmissionUniforms u;
  u.light = random->Next();
  u.position = random->Next2();
  u.direction = random->Next2();
  return u;
}

}  // namespace sheaf::render::testing
