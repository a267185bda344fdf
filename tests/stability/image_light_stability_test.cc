// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Row L5 of the catalogue of hard cases for point lights that emit by an image: goniometric maps,
// measured luminaires and projections. Their intensity is known in closed form; their power is its
// integral.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "common/film/exr/exr_codec.h"
#include "common/film/frame_image.h"
#include "common/math/elementary.h"
#include "tests/support/light_tables.h"
#include "tests/support/temporary_path.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

using testing::ColorOf;
using testing::kWhite;
using testing::MakePoint;
using testing::MakeTable;
using testing::RandomPoints;

LightDescription Goniometric(Rgb intensity = kWhite) {
  LightDescription light;
  light.light = GoniometricLight{ColorOf(intensity), "map.pfm", {}};
  light.location = {0, 12, 3};
  return light;
}
LightDescription Projection(float fov_degrees = 90) {
  LightDescription light;
  light.light = ProjectionLight{"map.pfm", fov_degrees};
  light.location = {0, 12, 3};
  return light;
}

class ImageLightStabilityTest : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = sheaf::testing::TemporaryPath("images");
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  absl::StatusOr<std::unique_ptr<LightTable>> Build(int width, const std::vector<Rgb>& texels,
                                                    const std::vector<LightDescription>& lights,
                                                    LightTableInput input = {}) {
    const std::string path = (directory_ / "map.pfm").string();
    testing::WritePfm(path, width, texels);
    SceneDescription scene;
    scene.files = {"room.pbrt"};
    scene.lights = lights;
    TableFileSource files({{"map.pfm", path}});
    return LightTable::Build(scene, std::move(input), files);
  }

  std::filesystem::path directory_;
};

// Intensity of a light at the origin towards d (a unit vector).
Rgb IntensityTowards(const LightTable& table, Vec3d d) {
  const auto sample = table.Sample<kAllTraits>(ToFloat(2 * d), {}, 0, {0, 0});
  if (!sample) return {};
  EXPECT_TRUE(sample->is_delta);
  EXPECT_EQ(sample->pdf, 1);
  return sample->radiance * 4;
}

TEST_F(ImageLightStabilityTest, ImagesCountAsMemory) {
  const auto none = MakeTable({}, {MakePoint(kWhite, {})});
  const std::vector<Rgb> texels(64 * 64, kWhite);
  const auto goniometric = Build(64, texels, {Goniometric()});
  const auto projection = Build(64, texels, {Projection()});
  ASSERT_TRUE(goniometric.ok() && projection.ok());
  EXPECT_GE((*goniometric)->memory_bytes(), none->memory_bytes() + 64 * 64 * sizeof(float));
  EXPECT_GE((*projection)->memory_bytes(), none->memory_bytes() + 64 * 64 * sizeof(Rgb));
  EXPECT_LE((*projection)->memory_bytes(), none->memory_bytes() + 2 * 64 * 64 * sizeof(Rgb));
}

TEST_F(ImageLightStabilityTest, L5GoniometricTexelsMatchPbrt) {
  constexpr int kSize = 8;
  RandomPoints random(7);
  std::vector<Rgb> texels(kSize * kSize);
  for (Rgb& c : texels) c = {random.Next(), random.Next(), random.Next()};
  const auto table = Build(kSize, texels, {Goniometric({2, 3, 4})});
  ASSERT_TRUE(table.ok()) << table.status();
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      // A texel is constant up to its edges. The center of the map is +y.
      for (const double off : {0.02, 0.5, 0.98}) {
        const Vec3d m = EqualAreaSquareToSphere({(x + off) / kSize, (y + 1 - off) / kSize});
        const Rgb c = texels[static_cast<size_t>(y * kSize + x)];
        const Rgb seen = IntensityTowards(**table, {m.x, m.z, m.y});
        for (size_t i = 0; i < 3; ++i) {
          EXPECT_NEAR(seen[i], static_cast<float>(i + 2) * (c.r + c.g + c.b) / 3, 2e-6);
        }
      }
    }
  }
}

TEST_F(ImageLightStabilityTest, L5GoniometricPowerIsTheIntegral) {
  constexpr int kSize = 4;
  std::vector<Rgb> texels(kSize * kSize, kWhite);
  texels[5] = {17, 17, 17};  // Mean 2.
  LightDescription light = Goniometric();
  const auto power = [&] {
    const auto table = Build(kSize, texels, {light});
    EXPECT_TRUE(table.ok()) << table.status();
    double sum = 0;
    for (int i = 0; i < kSize * kSize; ++i) {
      const Vec3d m =
          EqualAreaSquareToSphere({(i % kSize + 0.5) / kSize, (i / kSize + 0.5) / kSize});
      sum += static_cast<double>(IntensityTowards(**table, {m.x, m.z, m.y}).g);
    }
    return sum * 4 * kPi / (kSize * kSize);
  };
  EXPECT_NEAR(power(), 8 * kPi, 1e-5);
  light.scale.scale = 0.5f;
  EXPECT_NEAR(power(), 4 * kPi, 1e-5);
  light.scale = {1, 60};
  EXPECT_NEAR(power(), 60, 1e-4);
}

TEST_F(ImageLightStabilityTest, L5GoniometricWithoutMapIsAPointLight) {
  LightDescription light = Goniometric({1, 2, 3});
  std::get<GoniometricLight>(light.light).file.clear();
  light.world_from_light = TranslateMatrix({1, 2, 3});
  light.scale.power_w = 25;
  LightDescription point = MakePoint({1, 2, 3}, {1, 2, 3});
  point.scale.power_w = 25;
  const auto a = MakeTable({}, {light}), b = MakeTable({}, {point});
  const auto seen = a->Sample<kAllTraits>({4, -2, 0.5f}, {}, 0, {0, 0});
  const auto expected = b->Sample<kAllTraits>({4, -2, 0.5f}, {}, 0, {0, 0});
  ASSERT_TRUE(seen && expected);
  EXPECT_EQ(seen->radiance, expected->radiance);
}

LightDescription Luminaire(const CandelaTable& table) {
  LightDescription light;
  GoniometricLight goniometric{ColorOf(kWhite), "lamp.ies", table};
  light.light = goniometric;
  return light;
}
// Direction for the angles of LM-63: vertical from straight down (-y), horizontal from +x by +z.
Vec3d Towards(double vertical_degrees, double horizontal_degrees) {
  const double v = vertical_degrees * kPi / 180, h = horizontal_degrees * kPi / 180;
  return {std::sin(v) * std::cos(h), -std::cos(v), std::sin(v) * std::sin(h)};
}

TEST_F(ImageLightStabilityTest, L5CandelasAreLinearBetweenMeasuredAngles) {
  const CandelaTable table = {{0, 40, 90}, {30, 150, 270}, {8, 4, 2, 8, 1, 0, 8, 6, 12}};
  const auto point_light = MakeTable({}, {Luminaire(table)});
  const auto expect = [&](double vertical, double horizontal, double candela) {
    SCOPED_TRACE(std::to_string(vertical) + " " + std::to_string(horizontal));
    EXPECT_NEAR(IntensityTowards(*point_light, Towards(vertical, horizontal)).g, candela, 1e-4);
  };
  for (const double h : {0.0, 77.0, 200.0}) expect(0, h, 8);
  expect(40, 30, 4);
  expect(20, 30, 6);
  expect(65, 30, 3);
  expect(89.9, 150, 0.002);
  expect(40, 90, 2.5);
  expect(40, 210, 3.5);
  expect(40, 330, 5);  // Across 360 degrees, from either side.
  expect(40, 359.9, 6 - 2 * 89.9 / 120);
  expect(40, 0.1, 6 - 2 * 90.1 / 120);
  expect(90.1, 30, 0);
  expect(180, 30, 0);
}

TEST_F(ImageLightStabilityTest, L5PowerOfCandelasIsTheIntegral) {
  // Half of the directions at 3, in unevenly spaced planes: 6 pi.
  const CandelaTable half = {{0, 10, 90}, {0, 10, 200}, std::vector<float>(9, 3)};
  LightDescription light = Luminaire(half);
  light.scale.power_w = 60;
  EXPECT_NEAR(IntensityTowards(*MakeTable({}, {light}), Towards(70, 33)).r, 60 / (2 * kPi), 1e-5);
  // Intensity that grows with the angle v up to pi at the top: the mean of v over the sphere is pi
  // / 2.
  LightDescription ramp = Luminaire({{0, 180}, {0}, {0, 180}});
  EXPECT_NEAR(IntensityTowards(*MakeTable({}, {ramp}), Towards(45, 99)).r, 45, 1e-4);
  ramp.scale.power_w = 7;
  EXPECT_NEAR(IntensityTowards(*MakeTable({}, {ramp}), Towards(90, 99)).r, 7 / (4 * kPi), 1e-6);
  // One of two planes is dark: half of the power, and in the middle half of the intensity.
  LightDescription two = Luminaire({{0, 180}, {90, 270}, {2, 2, 0, 0}});
  two.scale.power_w = 1;
  EXPECT_NEAR(IntensityTowards(*MakeTable({}, {two}), Towards(80, 180)).r, 1 / (4 * kPi), 1e-6);
  EXPECT_TRUE(MakeTable({}, {Luminaire({{0, 180}, {0}, {0, 0}})})->empty());
}

// Files declare the primaries of their numbers: the same sky written with other primaries is the
// same light, and colors outside sRGB are moved to its boundary.
TEST_F(ImageLightStabilityTest, L6ImagesAreReadWithTheirPrimaries) {
  const Rgb sky{0.25f, 0.5f, 1};
  const auto radiance_of = [&](Rgb srgb, Primaries primaries) {
    FrameImage image = MakeFrameImage({0, 0, 2, 2}, 2, 2);
    for (const auto& [channel, value] :
         {std::pair{"R", srgb.r}, std::pair{"G", srgb.g}, std::pair{"B", srgb.b}}) {
      image.Find(channel)->assign(4, value);
    }
    EXPECT_TRUE(ConvertColor(ChromaticitiesOf(primaries), &image).ok());
    const std::string path = (directory_ / "sky.exr").string();
    EXPECT_TRUE(WriteFrameImage(image, path).ok());
    SceneDescription scene;
    scene.files = {"room.pbrt"};
    LightDescription light;
    light.light = InfiniteLight{.radiance = {}, .file = "sky.exr", .portal = {}};
    scene.lights = {light};
    TableFileSource files({{"sky.exr", path}});
    const auto table = LightTable::Build(scene, {}, files);
    EXPECT_TRUE(table.ok()) << table.status();
    return table.ok() ? (*table)->EnvironmentRadiance<kAllTraits>({}, {0, 0, 1}) : Rgb{};
  };
  for (const Primaries primaries :
       {Primaries::kSrgb, Primaries::kAces2065, Primaries::kAcesCg, Primaries::kRec2020}) {
    const Rgb read = radiance_of(sky, primaries);
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(read[c], sky[c], 1e-4f) << PrimariesName(primaries);
  }
  const Rgb laser = radiance_of({-0.5f, 1, 0.25f}, Primaries::kAces2065);
  EXPECT_EQ(laser.r, 0);
  EXPECT_NEAR(laser.g, 1, 1e-4f);
}

// A projector 2 above a plane, looking down: E = I cos / d^2 = I cos^3 / 4 inside the image, which
// is upright as seen from the projector.
TEST_F(ImageLightStabilityTest, L5ProjectionMatchesItsClosedForm) {
  // Three columns, two rows: the fov of 90 degrees is that of the height.
  const std::vector<Rgb> image = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}, {0, 1, 1}, {1, 0, 1}};
  const std::string path = (directory_ / "wide.pfm").string();
  std::ofstream out(path, std::ios::binary);
  out << "PF\n3 2\n-1\n";
  out.write(reinterpret_cast<const char*>(&image[3]), 3 * sizeof(Rgb));
  out.write(reinterpret_cast<const char*>(&image[0]), 3 * sizeof(Rgb));
  out.close();
  SceneDescription scene;
  scene.lights = {Projection()};
  std::get<ProjectionLight>(scene.lights[0].light).file = "wide.pfm";
  scene.lights[0].scale.scale = 5;
  Matrix4 world_from_light;
  ASSERT_TRUE(LookAtMatrix({0, 2, 0}, {0, 0, 0}, {0, 0, 1}, &world_from_light));
  scene.lights[0].world_from_light = world_from_light;
  TableFileSource files({{"wide.pfm", path}});
  const auto table = LightTable::Build(scene, {}, files);
  ASSERT_TRUE(table.ok()) << table.status();
  const Vec3d right = TransformVector(world_from_light, {1, 0, 0});
  const auto expect = [&](double x, double y, Rgb color) {
    const Vec3f p = ToFloat(right * x + Vec3d{0, 0, y});
    const auto estimate = testing::EstimateIrradiance(**table, p, {0, 1, 0}, 1);
    const auto sample = (*table)->Sample<kAllTraits>(p, {}, 0, {0, 0});
    const double cosine = 2 / std::sqrt(4 + x * x + y * y);
    const double e = 5 * cosine * cosine * cosine / 4;
    EXPECT_NEAR(estimate.mean, static_cast<double>(color.r) * e, 1e-6) << x << " " << y;
    ASSERT_EQ(sample.has_value(), !color.IsBlack());
    if (!sample) return;
    EXPECT_EQ(sample->radiance.g > 0, color.g > 0);
    EXPECT_EQ(sample->radiance.b > 0, color.b > 0);
  };
  expect(-2, 1, {1, 0, 0});  // Upper left.
  expect(0, 0.01, {0, 1, 0});
  expect(2.99, 1.99, {0, 0, 1});
  expect(-1.01, -0.01, {1, 1, 0});
  expect(0.99, -1.99, {0, 1, 1});
  expect(1.01, -1, {1, 0, 1});
  expect(3.01, 0.5, {});
  expect(-3.01, 0.5, {});
  expect(0.5, 2.01, {});
  expect(0.5, -2.01, {});
  EXPECT_FALSE((*table)->Sample<kAllTraits>({0.1f, 4, 0.1f}, {}, 0, {0, 0}));  // Behind.
}

// A square of 90 degrees is one of a cube's six faces.
TEST_F(ImageLightStabilityTest, L5ProjectionPowerIsTheIntegral) {
  for (const int size : {1, 5}) {
    const std::vector<Rgb> even(static_cast<size_t>(size * size), Rgb{3, 3, 3});
    LightDescription light = Projection();
    light.scale.power_w = 60;
    const auto table = Build(size, even, {light});
    ASSERT_TRUE(table.ok()) << table.status();
    const double intensity = 60 / (4 * kPi / 6);
    EXPECT_NEAR(IntensityTowards(**table, Normalize(Vec3d{0.9, -0.8, 1})).r, intensity, 1e-5);
  }
  // A quarter of the image has, by symmetry, a quarter of the power. For a narrow angle the solid
  // angle equals the area at unit distance.
  LightDescription light = Projection(0.01f);
  light.scale.power_w = 1;
  const auto table = Build(2, {Rgb{}, kWhite, Rgb{}, Rgb{}}, {light});
  ASSERT_TRUE(table.ok()) << table.status();
  const double half = 0.005 * kPi / 180;
  const Rgb seen = IntensityTowards(**table, Normalize(Vec3d{half / 2, half / 2, 1}));
  EXPECT_NEAR(seen.r * half * half, 1, 1e-5);
}

TEST_F(ImageLightStabilityTest, L5ImageLightsFollowTheirTransform) {
  LightDescription light = Projection(20);
  light.world_from_light =
      TranslateMatrix({12, 3, 4}) * ScaleMatrix({-7, 7, 7}) * RotateMatrix(90, {0, 1, 0});
  LightTableInput input;
  input.render_origin_world = {10, 0, 0};
  const auto table = Build(1, {kWhite}, {light}, input);
  ASSERT_TRUE(table.ok()) << table.status();
  const auto sample = (*table)->Sample<kAllTraits>({0, 3, 4}, {}, 0, {0, 0});
  ASSERT_TRUE(sample.has_value());
  EXPECT_NEAR(sample->wi.x, 1, 1e-6);
  EXPECT_NEAR(sample->radiance.r, 0.25, 1e-6);
  EXPECT_FALSE((*table)->Sample<kAllTraits>({4, 3, 4}, {}, 0, {0, 0}));
}

// In spectral transport the image has the spectra of its colors.
TEST_F(ImageLightStabilityTest, L5ImagesHaveSpectra) {
  const Rgb orange{2, 1, 0.25f};
  LightTableInput input;
  input.spectral = true;
  const auto table = Build(1, {orange}, {Projection()}, input);
  ASSERT_TRUE(table.ok()) << table.status();
  const Wavelengths wavelengths = Wavelengths::Sample(0.3f);
  const auto sample = (*table)->Sample<kAllSpectralTraits>({0, 0, 1}, {}, 0, {0, 0}, wavelengths);
  ASSERT_TRUE(sample.has_value());
  EXPECT_EQ(sample->radiance, Upsample(orange, ColorRole::kIlluminant, wavelengths));
}

// Each of several lights can be chosen where it contributes, and the contributions add up.
TEST_F(ImageLightStabilityTest, L5ImageLightsAreChosenWhereTheyEmit) {
  std::vector<Rgb> texels(64);
  texels[8 * 3 + 5] = {1e-3f, 1e-3f, 1e-3f};
  const auto table = Build(8, texels, {Goniometric(), MakePoint(kWhite, {0, 0, 0}), Projection()});
  ASSERT_TRUE(table.ok()) << table.status();
  const Vec3d m = EqualAreaSquareToSphere({5.5 / 8, 3.5 / 8});
  const Vec3d lit_by_map{m.x, m.z, m.y};
  const Vec3d lit_by_image = Normalize(Vec3d{(5.5 - 4) / 4, -(3.5 - 4) / 4, 1});
  for (const Vec3d d : {lit_by_map, lit_by_image}) {
    const auto estimate =
        testing::EstimateIrradiance(**table, ToFloat(d), ToFloat(-d), uint64_t{1} << 14);
    testing::ExpectNear(estimate, 1.001, 1e-6);
    EXPECT_LT(estimate.standard_error, 1e-4);
  }
}

TEST_F(ImageLightStabilityTest, L5BlackImagesAreNoLights) {
  for (LightDescription light : {Goniometric(), Projection()}) {
    light.scale.power_w = 60;
    const auto table = Build(2, std::vector<Rgb>(4), {light});
    ASSERT_TRUE(table.ok()) << table.status();
    EXPECT_TRUE((*table)->empty());
  }
}

TEST_F(ImageLightStabilityTest, L5InvalidImagesAreNamedErrors) {
  const auto expect = [&](const std::vector<Rgb>& texels, const LightDescription& light,
                          const std::string& what) {
    const auto table = Build(2, texels, {light});
    ASSERT_FALSE(table.ok());
    EXPECT_EQ(table.status().code(), absl::StatusCode::kInvalidArgument);
    const std::string message(table.status().message());
    EXPECT_NE(message.find("room.pbrt:12:3: "), std::string::npos) << message;
    EXPECT_NE(message.find(what), std::string::npos) << message;
  };
  for (const LightDescription& light : {Goniometric(), Projection()}) {
    std::vector<Rgb> texels(4, kWhite);
    texels[3].g = std::numeric_limits<float>::quiet_NaN();
    expect(texels, light, "\"map.pfm\" texel (1, 1) is ");
    texels[3].g = std::numeric_limits<float>::infinity();
    expect(texels, light, "\"map.pfm\" texel (1, 1) is ");
    texels[3].g = -9;
    expect(texels, light, "must be finite and not negative");
    texels[3].g = 1;
    LightDescription flat = light;
    flat.world_from_light = ScaleMatrix({1, 0, 1});
    expect(texels, flat, "the transform cannot be inverted");
    LightDescription loud = light;
    loud.scale.scale = 1e38f;
    texels[3] = {1e5f, 1e5f, 1e5f};
    expect(texels, loud, "not finite");
  }
}

}  // namespace
}  // namespace sheaf::render
