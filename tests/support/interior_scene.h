// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// InteriorScene: small scenes of objects with a subsurface medium, and renderings of them together
// with their counters.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

#include "common/scene/pbrt/statements/subsurface_reflectance.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {

class InteriorScene : public TestScene {
 public:
  using TestScene::TestScene;
  explicit InteriorScene(const TestScene& room) : TestScene(room) {}

  int32_t SubsurfaceOf(Rgb sigma_a, Rgb sigma_s, float g, float eta, float alpha = 0) {
    MediumDescription medium;
    medium.name = std::to_string(scene.media.size());
    medium.sigma_a.rgb = sigma_a;
    medium.sigma_s.rgb = sigma_s;
    medium.g = g;
    return AddSubsurfaceOf(std::move(medium), eta, alpha);
  }
  // A medium defined by its reflectance. texture: replaces the color.
  int32_t SubsurfaceWithReflectance(Rgb color, int32_t texture, float free_path, float g,
                                    float eta) {
    MediumDescription medium;
    medium.name = std::to_string(scene.media.size());
    medium.g = g;
    SubsurfaceReflectance reflectance;
    reflectance.color.rgb = color;
    reflectance.texture = texture;
    reflectance.free_path.rgb = Rgb::Gray(free_path);
    reflectance.eta = eta;
    SetReflectance(reflectance, &medium);
    return AddSubsurfaceOf(std::move(medium), eta, 0);
  }
  // A texture of two colors in world space: the first where the floor of the coordinate is even.
  int32_t Stripes(Rgb first, Rgb second, Vec3f across) {
    CheckerboardTexture board;
    board.mapping.kind = UvMapping::Kind::kPlanar;
    board.mapping.planar_u = across;
    board.mapping.planar_v = {};
    board.color[0].value.rgb = first;
    board.color[1].value.rgb = second;
    TextureDescription texture;
    texture.is_color = true;
    texture.texture = board;
    scene.textures.push_back(texture);
    return static_cast<int32_t>(scene.textures.size() - 1);
  }
  template <typename Shape>
  ShapeDescription& AddSubsurface(Shape shape, int32_t material, Matrix4 world_from_object = {}) {
    ShapeDescription& added = AddShape(shape, material, world_from_object);
    added.media.inside =
        std::get<SubsurfaceMaterial>(scene.materials[static_cast<size_t>(material)].material)
            .medium;
    return added;
  }

 private:
  int32_t AddSubsurfaceOf(MediumDescription medium, float eta, float alpha) {
    medium.is_subsurface = true;
    scene.media.push_back(std::move(medium));
    SubsurfaceMaterial material;
    material.roughness = {{alpha, kNone}, {alpha, kNone}, false};
    material.eta.mean = eta;
    material.medium = static_cast<int32_t>(scene.media.size() - 1);
    return AddMaterial(material);
  }
};

struct Rendered {
  TileMean mean;
  FilmTile film;
  RenderStats stats;
};
inline Rendered RenderCounted(const SceneDescription& scene, const FrameSettings& settings) {
  const CompiledScenePtr compiled = Compile(scene, settings);
  RenderStats stats;
  FilmTile film = RenderAll(*compiled, &stats);
  TileMean mean = MeanOf(film);
  return {mean, std::move(film), std::move(stats)};
}

// Compares two independent estimates of an image's mean: the tolerance is 5 standard errors of the
// difference, as in ExpectMean, plus 2e-4 for rounding in tables.
inline void ExpectSameMean(const TileMean& a, const TileMean& b) {
  EXPECT_EQ(a.non_finite + b.non_finite, 0u);
  for (size_t c = 0; c < 3; ++c) {
    const double error = std::hypot(static_cast<double>(a.standard_error[c]),
                                    static_cast<double>(b.standard_error[c]));
    EXPECT_NEAR(a.mean[c], b.mean[c], 5 * error + 2e-4) << "channel " << c;
  }
}
inline void ExpectSameBits(const FilmTile& a, const FilmTile& b) {
  for (const FilmChannel channel :
       {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi}) {
    for (size_t i = 0; i < a.plane_size(); ++i) {
      ASSERT_EQ(a.channel(channel)[i], b.channel(channel)[i]);
    }
  }
}

}  // namespace sheaf::render
