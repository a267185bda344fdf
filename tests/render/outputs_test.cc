// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Outputs of small scenes with known values: the tracer's records of first surfaces, light groups,
// and ids with their names.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include "common/film/cryptomatte.h"
#include "common/film/film.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

using ::testing::ElementsAre;

constexpr int32_t kSizePx = 16;

FrameImage RenderImage(const SceneDescription& scene, const FrameSettings& settings) {
  const CompiledScenePtr compiled = Compile(scene, settings);
  const FilmTile tile = RenderAll(*compiled);
  FrameImage image =
      MakeFrameImage(settings.window, settings.width_px, settings.height_px, settings.outputs);
  DevelopTile(tile, &image);
  NoteNames(tile, &image);
  return image;
}

float At(const FrameImage& image, const char* channel, int32_t x, int32_t y) {
  const std::vector<float>* plane = image.Find(channel);
  EXPECT_NE(plane, nullptr) << channel;
  return plane == nullptr ? 0 : (*plane)[static_cast<size_t>(y * kSizePx + x)];
}

// A camera at (5, 0, -2) that looks along +z at the wall z = 0, which fills the view: the view's
// half-width is 2 * tan 45 degrees = 2, and a pixel is 0.25 wide.
TestScene Wall() {
  TestScene t({5, 0, -2}, {5, 0, 0}, 90);
  const int32_t mesh = t.Quad({0, -5, 0}, {0, 5, 0}, {10, 5, 0}, {10, -5, 0});
  t.scene.meshes[static_cast<size_t>(mesh)].uvs = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  t.AddShape(MeshShape{mesh}, t.Diffuse(Rgb::Gray(0.5f)));
  t.ConstantEnvironment(Rgb::Gray(1));
  return t;
}

TEST(OutputsTest, FirstSurfaceInWorldSpace) {
  FrameSettings settings = SquareSettings(kSizePx, 64, 1);
  for (const Aov aov : {Aov::kPosition, Aov::kGeometricNormal, Aov::kShadingNormal, Aov::kUv}) {
    settings.outputs.Add(aov);
  }
  const FrameImage image = RenderImage(Wall().scene, settings);
  // A pixel's samples are spread over it; the mean of 64 points of a Sobol' sequence is within 1/64
  // of a pixel of its center. Pixel (3, 12) is 4.5 to the left and below; x increases to the right
  // of the left-handed camera.
  const float tolerance = 0.25f / 64;
  EXPECT_NEAR(At(image, "P.X", 3, 12), 5 - 4.5 * 0.25, tolerance);
  EXPECT_NEAR(At(image, "P.Y", 3, 12), -4.5 * 0.25, tolerance);
  EXPECT_EQ(At(image, "P.Z", 3, 12), 0);
  EXPECT_NEAR(At(image, "u", 3, 12), (5 - 4.5 * 0.25) / 10, tolerance / 10);
  EXPECT_NEAR(At(image, "v", 3, 12), (5 - 4.5 * 0.25) / 10, tolerance / 10);
  // Towards the viewer, whichever side is the mesh's front.
  for (const char* channel : {"N.Z", "Ns.Z"}) EXPECT_EQ(At(image, channel, 3, 12), -1);
  EXPECT_EQ(At(image, "N.X", 3, 12), 0);
}

TEST(OutputsTest, FirstSurfaceInCameraSpace) {
  FrameSettings settings = SquareSettings(kSizePx, 16, 1);
  settings.outputs.Add(Aov::kPosition);
  settings.outputs.Add(Aov::kGeometricNormal);
  settings.outputs.camera_space = true;
  TestScene t = Wall();
  t.SetCamera({5, 0, -2}, {5, 0, 0}, 90, {1, 0, 0});  // Rolled: up is world x.
  const FrameImage image = RenderImage(t.scene, settings);
  EXPECT_NEAR(At(image, "P.Y", 3, 12), -4.5 * 0.25, 0.02);
  EXPECT_NEAR(At(image, "P.X", 3, 12), -4.5 * 0.25, 0.02);
  EXPECT_NEAR(At(image, "P.Z", 3, 12), 2, 1e-6);
  EXPECT_EQ(At(image, "N.Z", 3, 12), -1);
}

// The wall moves by (0.5, 0.25) while the shutter is open: 2 pixels right and 1 up, at every time.
TEST(OutputsTest, MotionOfSurfaceAndCamera) {
  FrameSettings settings = SquareSettings(kSizePx, 16, 1);
  settings.outputs.Add(Aov::kMotion);
  TestScene t = Wall();
  EXPECT_EQ(At(RenderImage(t.scene, settings), "motion.X", 8, 8), 0);
  t.scene.camera.shutter_close = 1;
  TransformOverTime& moving = t.scene.shapes[0].world_from_object;
  moving.end = TranslateMatrix({0.5, 0.25, 0});
  FrameImage image = RenderImage(t.scene, settings);
  EXPECT_NEAR(At(image, "motion.X", 4, 9), 2, 1e-4);
  EXPECT_NEAR(At(image, "motion.Y", 4, 9), -1, 1e-4);
  // If the camera moves with the wall, there is no motion in the image.
  t.scene.camera.world_from_camera.end =
      TranslateMatrix({0.5, 0.25, 0}) * t.scene.camera.world_from_camera.start;
  image = RenderImage(t.scene, settings);
  EXPECT_NEAR(At(image, "motion.X", 4, 9), 0, 1e-4);
  EXPECT_NEAR(At(image, "motion.Y", 4, 9), 0, 1e-4);
}

// The same wall with moving vertices; then also with a moving transform, twice as far.
TEST(OutputsTest, MotionOfDeformation) {
  FrameSettings settings = SquareSettings(kSizePx, 16, 1);
  settings.outputs.Add(Aov::kMotion);
  TestScene t = Wall();
  t.scene.camera.shutter_close = 1;
  TriangleMesh& mesh = t.scene.meshes[0];
  mesh.steps.resize(2, VertexStep{mesh.positions, {}});
  for (Vec3f& p : mesh.steps[0].positions) p = p + Vec3f{0.5f, 0, 0};
  for (Vec3f& p : mesh.steps[1].positions) p = p + Vec3f{0.5f, 0.25f, 0};
  FrameImage image = RenderImage(t.scene, settings);
  EXPECT_NEAR(At(image, "motion.X", 4, 9), 2, 1e-4);
  EXPECT_NEAR(At(image, "motion.Y", 4, 9), -1, 1e-4);
  t.scene.shapes[0].world_from_object.end = TranslateMatrix({0.5, 0.25, 0});
  image = RenderImage(t.scene, settings);
  EXPECT_NEAR(At(image, "motion.X", 4, 9), 4, 1e-4);
  EXPECT_NEAR(At(image, "motion.Y", 4, 9), -2, 1e-4);
}

TestScene RoomWithGroups() {
  TestScene t = LitRoom(1);
  t.scene.area_lights[0].group = "ceiling";
  PointLight light;
  light.intensity.rgb = {0.5f, 0.1f, 0.1f};
  light.from = {0.4f, 0, -0.5f};
  t.scene.lights.push_back({light, {}, {}, {}, "lamp"});
  return t;
}

FrameSettings GroupSettings(const SceneDescription& scene, ColorTransport color) {
  RenderSettings asked;
  asked.light_groups = true;
  SceneDescription sized = scene;
  sized.film.width_px = sized.film.height_px = kSizePx;
  absl::StatusOr<FrameSettings> settings = ResolveSettings(sized, asked);
  EXPECT_TRUE(settings.ok()) << settings.status();
  settings->color = color;
  settings->samples = 32;
  settings->max_depth = 4;
  return *settings;
}

// Expects that the groups add up to the image and that each of `names` contributes.
void ExpectGroupsAddUp(const SceneDescription& scene, const std::vector<std::string>& names) {
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    const FrameSettings settings = GroupSettings(scene, color);
    ASSERT_EQ(settings.outputs.light_groups, names);
    const FrameImage image = RenderImage(scene, settings);
    for (const char* component : {"R", "G", "B"}) {
      std::vector<double> totals(names.size());
      for (int32_t y = 0; y < kSizePx; ++y) {
        for (int32_t x = 0; x < kSizePx; ++x) {
          double sum = 0, magnitude = 0;
          for (size_t i = 0; i < names.size(); ++i) {
            const double value =
                static_cast<double>(At(image, (names[i] + "." + component).c_str(), x, y));
            sum += value;
            magnitude += std::fabs(value);
            totals[i] += value;
          }
          EXPECT_NEAR(sum, At(image, component, x, y), 1e-5 * magnitude + 1e-7);
        }
      }
      for (size_t i = 0; i < names.size(); ++i) EXPECT_GT(totals[i], 0.1) << names[i];
    }
  }
}

TEST(OutputsTest, LightGroupsAddUpToTheImage) {
  ExpectGroupsAddUp(RoomWithGroups().scene, {"ceiling", "lamp"});
}

TEST(OutputsTest, OverlappingSkiesShareTheLight) {
  TestScene t = Wall();
  t.ConstantEnvironment({0.2f, 0.4f, 0.8f});
  t.scene.lights[1].group = "blue";
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(2);
  sun.from = {0, 0, -1};
  sun.to = {0, 0, 0};
  t.scene.lights.push_back({sun, {}, {}, {}, "sun"});
  ExpectGroupsAddUp(t.scene, {"blue", "default", "sun"});
  // Without scattering between them the two skies differ only by their colors.
  const FrameSettings settings = GroupSettings(t.scene, ColorTransport::kRgb);
  const FrameImage image = RenderImage(t.scene, settings);
  EXPECT_NEAR(At(image, "blue.G", 5, 5), 0.4 * At(image, "default.G", 5, 5), 1e-5);
}

// A group's light equals the image of the scene with all other lights removed.
TEST(OutputsTest, GroupEqualsTheImageOfItsLights) {
  const TestScene both = RoomWithGroups();
  FrameSettings settings = GroupSettings(both.scene, ColorTransport::kRgb);
  settings.samples = 256;
  const FrameImage image = RenderImage(both.scene, settings);
  TestScene alone = both;
  alone.scene.lights.clear();
  settings.outputs = {};
  const TileMean mean = RenderMean(alone.scene, settings);
  double sum = 0;
  for (const float value : *image.Find("ceiling.G")) sum += static_cast<double>(value);
  EXPECT_NEAR(sum / (kSizePx * kSizePx), mean.mean.g,
              8 * static_cast<double>(mean.standard_error.g));
}

TEST(OutputsTest, ImageKeepsItsBits) {
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    const TestScene t = RoomWithGroups();
    FrameSettings settings = GroupSettings(t.scene, color);
    for (size_t i = 0; i < kAovCount; ++i) settings.outputs.Add(static_cast<Aov>(i));
    settings.outputs.AddCryptomatte(IdKind::kObject);
    const FrameImage with = RenderImage(t.scene, settings);
    settings.outputs = {};
    const FrameImage without = RenderImage(t.scene, settings);
    for (size_t i = 0; i < without.planes.size(); ++i) {
      EXPECT_EQ(*with.Find(without.channel_names[i]), without.planes[i])
          << without.channel_names[i];
    }
  }
}

// Two instances of a ball left and right of the center, in front of the wall.
TestScene Balls() {
  TestScene t = Wall();
  t.scene.files = {"room.pbrt", "wall.pbrt"};
  t.scene.shapes[0].location = {1, 12, 3};
  const int32_t paint = t.Diffuse(Rgb::Gray(0.3f));
  t.scene.materials[static_cast<size_t>(paint)].name = "paint";
  t.scene.materials[0].location = {0, 4, 1};
  t.AddLooseShape(SphereShape{0.5f, -0.5f, 0.5f, 360}, paint);
  t.scene.objects.push_back({"ball", {1}, {}});
  for (const double x : {4.0, 6.0}) {
    ObjectInstance instance;
    instance.object = 0;
    instance.world_from_instance.start = instance.world_from_instance.end =
        TranslateMatrix({x, 0, -0.5});
    t.scene.instances.push_back(instance);
  }
  return t;
}

TEST(OutputsTest, IdsAndTheirNames) {
  FrameSettings settings = SquareSettings(kSizePx, 16, 1);
  for (const IdKind kind : {IdKind::kObject, IdKind::kMaterial, IdKind::kAsset}) {
    settings.outputs.AddCryptomatte(kind);
    settings.outputs.AddIdNumber(kind);
  }
  const FrameImage image = RenderImage(Balls().scene, settings);
  EXPECT_THAT(image.id_names[0], ElementsAre("ball#1", "ball#2", "diffuse.mesh#1"));
  EXPECT_THAT(image.id_names[1], ElementsAre("diffuse#1", "paint"));
  EXPECT_THAT(image.id_names[2], ElementsAre("ball", "wall.pbrt"));
  const auto is = [&](const char* channel, int32_t x, const char* name) {
    const float id = At(image, channel, x, 8);
    return std::bit_cast<uint32_t>(id) == CryptomatteIdBits(name);
  };
  // A ball's center is 1 off the axis at a depth of 1.5: 5.3 pixels from the image center.
  EXPECT_TRUE(is("CryptoObject00.R", 2, "ball#1"));
  EXPECT_TRUE(is("CryptoObject00.R", 13, "ball#2"));
  EXPECT_TRUE(is("CryptoObject00.R", 8, "diffuse.mesh#1"));
  EXPECT_TRUE(is("CryptoMaterial00.R", 13, "paint"));
  EXPECT_TRUE(is("CryptoAsset00.R", 2, "ball"));
  EXPECT_EQ(At(image, "CryptoObject00.G", 8, 8), 1);
  EXPECT_EQ(At(image, "objectId", 2, 8), 3);
  EXPECT_EQ(At(image, "materialId", 2, 8), 2);
  // The coverage of every pixel is complete, since the wall is behind everything.
  for (int32_t x = 0; x < kSizePx; ++x) {
    float coverage = At(image, "rest.CryptoObject", x, 7);
    for (const char* channel : {"CryptoObject00.G", "CryptoObject00.A", "CryptoObject01.G"}) {
      coverage += At(image, channel, x, 7);
    }
    EXPECT_NEAR(coverage, 1, 1e-6);
  }
}

}  // namespace
}  // namespace sheaf::render
