// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/material.h"

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/image/image_io.h"
#include "gtest/gtest.h"
#include "tests/support/temporary_path.h"

namespace sheaf::render {
namespace {

constexpr uint64_t kCacheBytes = uint64_t{16} << 20;

ColorInput Constant(Rgb rgb) {
  ColorInput input;
  input.value.rgb = rgb;
  return input;
}
ColorInput TextureColor(int32_t texture) {
  ColorInput input;
  input.texture = texture;
  return input;
}
TextureDescription ColorTexture(decltype(TextureDescription::texture) texture) {
  TextureDescription description;
  description.name = "t";
  description.is_color = true;
  description.texture = std::move(texture);
  description.location = {0, 7, 3};
  return description;
}

// A scene of textures and materials only.
struct Fixture {
  SceneDescription scene;
  std::map<std::string, std::string> paths;

  Fixture() { scene.files = {"room.pbrt"}; }
  int32_t AddTexture(TextureDescription texture) {
    scene.textures.push_back(std::move(texture));
    return static_cast<int32_t>(scene.textures.size()) - 1;
  }
  template <typename Material>
  int32_t AddMaterial(Material material) {
    scene.materials.push_back({"", std::move(material), {0, 12, 1}});
    return static_cast<int32_t>(scene.materials.size()) - 1;
  }
  absl::StatusOr<std::unique_ptr<MaterialTable>> Build(uint64_t cache_bytes = kCacheBytes) const {
    TableFileSource files(paths);
    return MaterialTable::Build(scene, files, {cache_bytes});
  }
};

Rgb ColorAt(const MaterialTable& table, int32_t material, Vec2f uv) {
  TexturePoint point;
  point.uv = uv;
  return table.Evaluate<kAllTraits>(material, point, 0.5f).color;
}

// 2 x 2: red green / blue white, top row first.
ImageTexture FourTexels(Fixture* fixture) {
  const std::string path = sheaf::testing::TemporaryPath("four.png");
  EXPECT_TRUE(WritePng(path, 2, 2, {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 255}}).ok());
  fixture->paths["four.png"] = path;
  ImageTexture image;
  image.file = "four.png";
  return image;
}

TEST(MaterialTableTest, ImagesStartAtTheTopRow) {
  Fixture f;
  const int32_t t = f.AddTexture(ColorTexture(FourTexels(&f)));
  const int32_t m = f.AddMaterial(DiffuseMaterial{TextureColor(t)});
  const auto table = f.Build();
  ASSERT_TRUE(table.ok()) << table.status();
  EXPECT_EQ(ColorAt(**table, m, {0.25f, 0.75f}), (Rgb{1, 0, 0}));
  EXPECT_EQ(ColorAt(**table, m, {0.75f, 0.75f}), (Rgb{0, 1, 0}));
  EXPECT_EQ(ColorAt(**table, m, {0.25f, 0.25f}), (Rgb{0, 0, 1}));
  EXPECT_EQ(ColorAt(**table, m, {5.25f, -2.75f}), (Rgb{0, 0, 1}));      // Repeats.
  EXPECT_EQ(ColorAt(**table, m, {0.5f, 0.75f}), (Rgb{0.5f, 0.5f, 0}));  // Half way.
}

TEST(MaterialTableTest, WrapModesDecideBeyondTheEdge) {
  for (const auto& [wrap, expected] : {std::pair{TextureWrap::kBlack, Rgb{0, 0, 0}},
                                       std::pair{TextureWrap::kClamp, Rgb{1, 0, 0}}}) {
    Fixture f;
    ImageTexture image = FourTexels(&f);
    image.wrap = wrap;
    const int32_t t = f.AddTexture(ColorTexture(image));
    const int32_t m = f.AddMaterial(DiffuseMaterial{TextureColor(t)});
    const auto table = f.Build();
    ASSERT_TRUE(table.ok()) << table.status();
    EXPECT_EQ(ColorAt(**table, m, {-1.5f, 1.5f}), expected);
    // A NaN coordinate must not index out of range.
    EXPECT_TRUE(IsFinite(ColorAt(**table, m, {std::nanf(""), 1e30f})));
  }
}

TEST(MaterialTableTest, CheckerboardsMixesAndScalesNest) {
  Fixture f;
  CheckerboardTexture board;
  board.color[0] = Constant(Rgb::Gray(1));
  board.color[1] = Constant(Rgb::Gray(0));
  board.mapping.scale_u = board.mapping.scale_v = 2;
  const int32_t checker = f.AddTexture(ColorTexture(board));
  ScaleTexture scale{TextureColor(checker), {}, {.value = 0.5f}};
  const int32_t scaled = f.AddTexture(ColorTexture(scale));
  MixTexture mix;
  mix.color[0] = TextureColor(scaled);
  mix.color[1] = Constant(Rgb::Gray(1));
  mix.amount.value = 0.25f;
  const int32_t m = f.AddMaterial(DiffuseMaterial{TextureColor(f.AddTexture(ColorTexture(mix)))});
  const auto table = f.Build();
  ASSERT_TRUE(table.ok()) << table.status();
  EXPECT_FLOAT_EQ(ColorAt(**table, m, {0.25f, 0.25f}).r, 0.75f * 0.5f + 0.25f);
  EXPECT_FLOAT_EQ(ColorAt(**table, m, {0.75f, 0.25f}).r, 0.25f);
}

TEST(MaterialTableTest, ConstantTexturesNeedNoTextureTrait) {
  Fixture f;
  ScaleTexture scale{Constant(Rgb::Gray(0.8f)), {}, {.value = 0.5f}};
  const int32_t t = f.AddTexture(ColorTexture(scale));
  const int32_t m = f.AddMaterial(DiffuseMaterial{TextureColor(t)});
  const auto table = f.Build();
  ASSERT_TRUE(table.ok());
  const Bsdf bsdf =
      (*table)->Evaluate<static_cast<TraitBits>(Trait::kAreaLights)>(m, TexturePoint{}, 0);
  EXPECT_FLOAT_EQ(bsdf.color.r, 0.4f);
}

TEST(MaterialTableTest, MixesReuseTheirRandomNumber) {
  Fixture f;
  const int32_t a = f.AddMaterial(DiffuseMaterial{Constant({1, 0, 0})});
  const int32_t b = f.AddMaterial(DiffuseMaterial{Constant({0, 1, 0})});
  const int32_t c = f.AddMaterial(DiffuseMaterial{Constant({0, 0, 1})});
  const int32_t inner = f.AddMaterial(MixMaterial{{a, b}, {.value = 0.25f}});
  const int32_t outer = f.AddMaterial(MixMaterial{{inner, c}, {.value = 0.5f}});
  const auto table = f.Build();
  ASSERT_TRUE(table.ok());
  Rgb mean;
  for (int i = 0; i < 8000; ++i) {
    mean += (*table)->Evaluate<kAllTraits>(outer, {}, (static_cast<float>(i) + 0.5f) / 8000).color *
            (1.0f / 8000);
  }
  EXPECT_NEAR(mean.r, 0.375, 1e-3);
  EXPECT_NEAR(mean.g, 0.125, 1e-3);
  EXPECT_NEAR(mean.b, 0.5, 1e-3);
}

TEST(MaterialTableTest, InvalidScenesAreErrorsWithALocation) {
  Fixture itself;
  MixMaterial loop{{0, 0}, {.value = 0.5f}};
  itself.AddMaterial(loop);
  Fixture circle;
  circle.AddTexture(ColorTexture(ScaleTexture{TextureColor(1), {}, {.value = 1}}));
  circle.AddTexture(ColorTexture(ScaleTexture{TextureColor(0), {}, {.value = 1}}));
  Fixture absent;
  ImageTexture image;
  image.file = "absent.png";
  absent.AddTexture(ColorTexture(image));
  Fixture doubling;  // 2^30 evaluations for one lookup if it were accepted.
  CheckerboardTexture leaf;
  doubling.AddTexture(ColorTexture(leaf));
  for (int32_t i = 0; i < 30; ++i) {
    MixTexture mix;
    mix.color[0] = mix.color[1] = TextureColor(i);
    doubling.AddTexture(ColorTexture(mix));
  }
  for (const auto& [fixture, place, what] :
       {std::tuple{&itself, "room.pbrt:12:1", "mixes itself"},
        std::tuple{&circle, "room.pbrt:7:3", "refers to itself"},
        std::tuple{&absent, "room.pbrt:7:3", "absent.png"},
        std::tuple{&doubling, "room.pbrt:7:3", "evaluates more than"}}) {
    const absl::Status status = fixture->Build().status();
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(std::string(status.message()).rfind(place, 0), 0u) << status;
    EXPECT_NE(std::string(status.message()).find(what), std::string::npos) << status;
  }
}

TEST(MaterialTableTest, LookupsDoNotDependOnTheCacheState) {
  Fixture f;
  std::vector<Rgb8> pixels;
  for (int i = 0; i < 300 * 300; ++i) {
    pixels.push_back({static_cast<uint8_t>(i * 7), static_cast<uint8_t>(i * 13), 50});
  }
  ASSERT_TRUE(WritePng(sheaf::testing::TemporaryPath("large.png"), 300, 300, pixels).ok());
  f.paths["large.png"] = sheaf::testing::TemporaryPath("large.png");
  ImageTexture image;
  image.file = "large.png";
  const int32_t t = f.AddTexture(ColorTexture(image));
  const int32_t m = f.AddMaterial(DiffuseMaterial{TextureColor(t)});
  const auto large = f.Build(), tiny = f.Build(1);
  ASSERT_TRUE(large.ok() && tiny.ok());
  for (int i = 0; i < 500; ++i) {
    const Vec2f uv{std::fmod(static_cast<float>(i) * 0.618f, 1.0f),
                   std::fmod(static_cast<float>(i) * 0.414f, 1.0f)};
    EXPECT_EQ(ColorAt(**large, m, uv), ColorAt(**tiny, m, uv));
  }
}

TEST(MaterialTableTest, SheetsScaleAndClampBothFractions) {
  Fixture f;
  const int32_t t = f.AddTexture(ColorTexture(FourTexels(&f)));
  DiffuseTransmissionMaterial sheet;
  sheet.reflectance = Constant({0.2f, 0.4f, 0.8f});
  sheet.transmittance = Constant({0.1f, 0.2f, 0.3f});
  sheet.scale = 2;
  const int32_t plain = f.AddMaterial(sheet);
  sheet.transmittance = TextureColor(t);
  const int32_t textured = f.AddMaterial(sheet);
  const auto table = f.Build();
  ASSERT_TRUE(table.ok()) << table.status();
  TexturePoint point;
  point.uv = {0.25f, 0.75f};
  for (const int32_t material : {plain, textured}) {
    const Bsdf bsdf = (*table)->Evaluate<kAllTraits>(material, point, 0);
    EXPECT_EQ(bsdf.kind, BsdfKind::kDiffuseTransmission);
    EXPECT_EQ(bsdf.color, (Rgb{0.4f, 0.8f, 1}));
    EXPECT_EQ(bsdf.conductor_eta, material == plain ? (Rgb{0.2f, 0.4f, 0.6f}) : (Rgb{1, 0, 0}));
  }
}

TEST(MaterialTableTest, AlphaIsTheSquareRootOfRoughness) {
  Fixture f;
  CoatedDiffuseMaterial coat;
  coat.roughness.u.value = 0.25f;
  coat.roughness.v.value = 0.04f;
  const int32_t remapped = f.AddMaterial(coat);
  coat.roughness.remap_roughness = false;
  const int32_t plain = f.AddMaterial(coat);
  const auto table = f.Build();
  ASSERT_TRUE(table.ok());
  EXPECT_EQ((*table)->Evaluate<kAllTraits>(remapped, {}, 0).alpha_x, 0.5f);
  EXPECT_EQ((*table)->Evaluate<kAllTraits>(remapped, {}, 0).alpha_y, 0.2f);
  EXPECT_EQ((*table)->Evaluate<kAllTraits>(plain, {}, 0).alpha_x, 0.25f);
  EXPECT_NE((*table)->Evaluate<kAllTraits>(plain, {}, 0).coat, nullptr);
}

TEST(MaterialTableTest, TexturedRoughnessFindsItsTableRows) {
  Fixture f;
  TextureDescription board;
  board.name = "r";
  CheckerboardTexture checker;
  checker.value[0].value = 0;
  checker.value[1].value = 0.09f;
  board.texture = checker;
  const int32_t t = f.AddTexture(board);
  ConductorMaterial metal;
  metal.has_reflectance = true;
  metal.reflectance = Constant(Rgb::Gray(1));
  metal.roughness.u.texture = metal.roughness.v.texture = t;
  const int32_t m = f.AddMaterial(metal);
  const auto table = f.Build();
  ASSERT_TRUE(table.ok()) << table.status();
  TexturePoint point;
  point.uv = {0.5f, 0.5f};
  EXPECT_TRUE((*table)->Evaluate<kAllTraits>(m, point, 0).specular);
  point.uv = {1.5f, 0.5f};
  const Bsdf rough = (*table)->Evaluate<kAllTraits>(m, point, 0);
  EXPECT_FALSE(rough.specular);
  EXPECT_FLOAT_EQ(rough.alpha_x, 0.3f);
  ASSERT_NE(rough.conductor_energy, nullptr);
  EXPECT_NEAR(rough.color.r, 1, 1e-6);
}

}  // namespace
}  // namespace sheaf::render
