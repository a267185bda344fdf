// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/gltf_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/base/file.h"
#include "common/scene/derived_files.h"
#include "common/scene/file_source.h"
#include "common/scene/gltf/parsable_json.h"
#include "common/scene/gltf/surrounding/surrounding.h"
#include "tests/support/gltf_text.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

using testing::File;
using testing::kAccessors;
using testing::kMesh;
using testing::kOneNode;
using testing::Notes;
using testing::Read;

TEST(GltfReaderTest, EmbeddedImagesNeedNoName) {
  const std::string named = R"({"images":[{"mimeType":"image/png","uri":"lava.png"}]})";
  EXPECT_EQ(gltf::ParsableJson(named), named);
  EXPECT_EQ(gltf::ParsableJson(
                R"({"images":[{"bufferView":0,"mimeType":"image/png","uri":"lava.png"}]})"),
            R"({"images":[{"bufferView":0,"mimeType":"image/png"}]})");
}

TEST(GltfReaderTest, ReadsATriangle) {
  const auto read = Read(File(kOneNode));
  ASSERT_TRUE(read.ok()) << read.status();
  const SceneDescription& scene = read->scene;
  ASSERT_EQ(scene.world_shapes.size(), 1u);
  const ShapeDescription& shape = scene.shapes[0];
  EXPECT_EQ(shape.world_from_object.start.m[2][3], 3);
  EXPECT_FALSE(shape.world_from_object.IsAnimated());
  const TriangleMesh& mesh = scene.meshes[0];
  EXPECT_EQ(mesh.positions[1], (Vec3f{1, 0, 0}));
  EXPECT_EQ(mesh.uvs[2], (Vec2f{0, 0}));  // The file's v points downwards.
  EXPECT_EQ(mesh.indices, (std::vector<uint32_t>{0, 1, 2}));
  const auto& material =
      std::get<PrincipledMaterial>(scene.materials[static_cast<size_t>(shape.material)].material);
  EXPECT_EQ(material.base_color.value.rgb, (Rgb{0, 1, 0}));
  EXPECT_EQ(material.metallic.value, 0.25f);
  EXPECT_EQ(material.roughness.value, 1);
  EXPECT_THAT(Notes(*read), HasSubstr("a.gltf: has no camera"));
  EXPECT_THAT(Notes(*read), HasSubstr("has no light"));
  EXPECT_EQ(scene.lights.size(), 1u);
}

TEST(GltfReaderTest, SharedMeshesBecomeInstances) {
  const auto read = Read(File(R"("materials": [{}], "nodes": [{"mesh": 0}, {"mesh": 0,
    "translation": [4, 0, 0]}, {"mesh": 0, "scale": [0, 0, 0]}],
    "scenes": [{"nodes": [0, 1, 2]}])"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->scene.objects.size(), 1u);
  EXPECT_EQ(read->scene.instances.size(), 2u);
  EXPECT_TRUE(read->scene.world_shapes.empty());
  EXPECT_THAT(Notes(*read), HasSubstr("scaled to nothing"));
}

TEST(GltfReaderTest, VolumesAbsorbInside) {
  const auto read = Read(File(R"("materials": [{"extensions": {
    "KHR_materials_transmission": {"transmissionFactor": 1},
    "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.5,
                             "attenuationColor": [0.25, 1, 1]}}}],
    "nodes": [{"mesh": 0}, {"mesh": 0, "translation": [4, 0, 0]}],
    "scenes": [{"nodes": [0, 1]}])"));
  ASSERT_TRUE(read.ok()) << read.status();
  const SceneDescription& scene = read->scene;
  ASSERT_EQ(scene.media.size(), 1u);
  ASSERT_EQ(scene.shapes.size(), 1u);
  EXPECT_EQ(scene.shapes[0].media.inside, 0);
  EXPECT_EQ(scene.shapes[0].media.outside, kNone);
  EXPECT_NEAR(scene.media[0].sigma_a.rgb[0], 2 * std::log(4.0f), 1e-5f);
  EXPECT_EQ(scene.media[0].sigma_a.rgb[1], 0);
}

TEST(GltfReaderTest, AnimationsGiveTheFrameAndItsBlur) {
  const std::string rest = kOneNode + R"(, "animations": [{"samplers": [
    {"input": 3, "output": 4}, {"input": 3, "output": 5}], "channels": [
    {"sampler": 0, "target": {"node": 0, "path": "translation"}},
    {"sampler": 1, "target": {"node": 0, "path": "rotation"}}]}])";
  GltfView view;
  view.time_s = 0.5;
  view.shutter_s = 0.25;
  const auto read = Read(File(rest), view);
  ASSERT_TRUE(read.ok()) << read.status();
  const TransformOverTime& place = read->scene.shapes[0].world_from_object;
  EXPECT_DOUBLE_EQ(place.start.m[0][3], 1);
  EXPECT_DOUBLE_EQ(place.end.m[0][3], 1.5);
  EXPECT_NEAR(place.start.m[1][0], std::sqrt(0.5), 1e-6);  // Half of a quarter turn.
}

TEST(GltfReaderTest, TexturesHaveChannelsTransformsAndWraps) {
  const auto read = Read(File(R"("materials": [{"alphaMode": "MASK", "alphaCutoff": 0.25,
    "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 0.5],
      "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {
        "offset": [0.5, 0], "scale": [2, 3]}}},
      "metallicRoughnessTexture": {"index": 0}}}],
    "textures": [{"source": 0, "sampler": 0}], "images": [{"uri": "wood.png"}],
    "samplers": [{"wrapS": 33071, "wrapT": 33648}],
    "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}])"));
  ASSERT_TRUE(read.ok()) << read.status();
  const SceneDescription& scene = read->scene;
  const auto texture = [&](int32_t index) {
    return std::get<ImageTexture>(scene.textures[static_cast<size_t>(index)].texture);
  };
  const auto& material = std::get<PrincipledMaterial>(scene.materials[0].material);
  const ImageTexture color = texture(material.base_color.texture);
  EXPECT_EQ(color.file, "wood.png");
  EXPECT_EQ(color.encoding, ColorEncoding::kSrgb);
  EXPECT_EQ(color.tint, (Rgb{1, 0.5f, 0.25f}));
  EXPECT_EQ(color.wrap, TextureWrap::kClamp);
  EXPECT_EQ(color.wrap_v, TextureWrap::kMirror);
  EXPECT_EQ(color.mapping.scale_u, 2);
  EXPECT_EQ(color.mapping.offset_u, 0.5f);
  EXPECT_EQ(color.mapping.offset_v, 1 - 3);
  EXPECT_EQ(texture(material.metallic.texture).channel, 2);
  EXPECT_EQ(texture(material.roughness.texture).channel, 1);
  EXPECT_EQ(texture(material.roughness.texture).encoding, ColorEncoding::kLinear);
  const ImageTexture alpha = texture(scene.shapes[0].alpha.texture);
  EXPECT_EQ(alpha.channel, 3);
  EXPECT_EQ(alpha.threshold, 0.25f);
  EXPECT_EQ(alpha.scale, 0.5f);
}

TEST(GltfReaderTest, EmissionIsPlacedByItsSampler) {
  const auto read = Read(File(R"("materials": [
    {"emissiveFactor": [1, 0.5, 0], "emissiveTexture": {"index": 0, "extensions": {
      "KHR_texture_transform": {"offset": [0.5, 0], "scale": [2, 3]}}}},
    {"emissiveFactor": [0.25, 0.25, 0.25], "emissiveTexture": {"index": 1}}],
    "textures": [{"source": 0, "sampler": 0}, {"source": 0}], "images": [{"uri": "wood.png"}],
    "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
    "nodes": [{"mesh": 0}, {"mesh": 1}], "scenes": [{"nodes": [0, 1]}])",
                              R"("meshes": [{"primitives": [
    {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]},
    {"primitives": [
    {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 1}]}],)"));
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->scene.area_lights.size(), 2u);
  const AreaLightDescription& placed = read->scene.area_lights[0];
  EXPECT_EQ(placed.file, "wood.png");
  EXPECT_EQ(placed.tint, (Rgb{1, 0.5f, 0}));
  EXPECT_EQ(placed.scale.scale, 1);
  EXPECT_EQ(placed.placement.wrap_u, TextureWrap::kClamp);
  EXPECT_EQ(placed.placement.wrap_v, TextureWrap::kMirror);
  EXPECT_TRUE(placed.placement.is_nearest);
  EXPECT_EQ(placed.placement.mapping.scale_u, 2);
  EXPECT_EQ(placed.placement.mapping.offset_v, 1 - 3);
  const AreaLightDescription& plain = read->scene.area_lights[1];
  EXPECT_EQ(plain.tint, Rgb::Gray(1));
  EXPECT_EQ(plain.scale.scale, 0.25f);
  EXPECT_EQ(plain.placement.wrap_u, TextureWrap::kRepeat);
  EXPECT_EQ(plain.placement.wrap_v, TextureWrap::kRepeat);
  EXPECT_FALSE(plain.placement.is_nearest);
}

TEST(GltfReaderTest, WhatEmitsDoesNotReplaceTheSurrounding) {
  const std::string shines =
      R"("materials": [{"emissiveFactor": [1, 1, 1]}], "nodes": [{"mesh": 0}])";
  auto read = Read(File(shines));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->scene.area_lights.size(), 1u);
  EXPECT_EQ(read->scene.lights.size(), 1u);
  EXPECT_THAT(Notes(*read), HasSubstr("a white surrounding lights it"));
  GltfView none;
  none.environment = GltfView::kNoEnvironment;
  read = Read(File(shines), none);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_TRUE(read->scene.lights.empty());
  // Lights of the file's own are meant to be all.
  read = Read(File(R"("extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
    "materials": [{}], "nodes": [{"mesh": 0,
      "extensions": {"KHR_lights_punctual": {"light": 0}}}])"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->scene.lights.size(), 1u);
  EXPECT_TRUE(std::holds_alternative<PointLight>(read->scene.lights[0].light));
}

// Regression: a white model before a white surrounding is hardly seen.
TEST(GltfReaderTest, ASurroundingThatIsBrighterAboveIsAmongTheFiles) {
  const std::string folder = ::testing::TempDir();
  EXPECT_TRUE(WriteFileOnce(folder + "/b.gltf", File(kOneNode)).ok());
  DirectoryFileSource files(folder, std::make_shared<DerivedFiles>());
  const auto read = ReadGltf("b.gltf", files, {}, {});
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->scene.lights.size(), 1u);
  const LightDescription& light = read->scene.lights[0];
  EXPECT_EQ(std::get<InfiniteLight>(light.light).file, "b.gltf.surrounding.pfm");
  EXPECT_EQ(TransformVector(light.world_from_light, {0, 0, 1}), (Vec3d{0, 1, 0}));
  EXPECT_THAT(Notes(*read), HasSubstr("a gray surrounding, bright above, lights it"));
  EXPECT_EQ(*ReadWholeFile(files.FilesUsed().at("b.gltf.surrounding.pfm")), gltf::SurroundingMap());
  // Workers have the file of that name.
  TableFileSource table(files.FilesUsed());
  const auto again = ReadGltf("b.gltf", table, {}, {});
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(std::get<InfiniteLight>(again->scene.lights.at(0).light).file,
            "b.gltf.surrounding.pfm");
}

TEST(GltfReaderTest, WhatIsLeftOutIsNotedOnceWithItsCount) {
  const auto read = Read(File(R"("materials": [
    {"occlusionTexture": {"index": 0}}, {"name": "b", "occlusionTexture": {"index": 0}},
    {"occlusionTexture": {"index": 0}}],
    "textures": [{"source": 0}], "images": [{"uri": "wood.png"}],
    "nodes": [{"mesh": 0}, {"mesh": 0, "name": "other"}, {"mesh": 0}], "scenes": [{"nodes": [0]}])",
                              R"("meshes": [{"name": "leaf", "primitives": [
    {"attributes": {"POSITION": 0, "COLOR_0": 0}, "indices": 2, "material": 0},
    {"attributes": {"POSITION": 0, "COLOR_0": 0}, "indices": 2, "material": 1},
    {"attributes": {"POSITION": 0, "JOINTS_0": 0}, "indices": 2, "material": 2},
    {"attributes": {"POSITION": 0}, "indices": 2, "mode": 0},
    {"attributes": {"POSITION": 0}, "indices": 2, "mode": 1,
     "targets": [{"COLOR_0": 0}]},
    {"attributes": {"POSITION": 0}, "indices": 2, "targets": [{"TEXCOORD_0": 1}]}]}],)"));
  ASSERT_TRUE(read.ok()) << read.status();
  const std::string notes = Notes(*read);
  EXPECT_THAT(notes, HasSubstr("a.gltf: material 0, and 2 others: its occlusion has no effect"));
  EXPECT_THAT(notes, HasSubstr("primitive 3: points are spheres, 1/500 of the scene's diagonal"));
  EXPECT_THAT(notes, HasSubstr("primitive 4: lines are tubes, 1/1000 of the scene's diagonal"));
  EXPECT_THAT(notes, HasSubstr("primitive 2: joints without weights"));
  EXPECT_THAT(notes, HasSubstr("primitive 4, and 1 other: morph targets of uv and colors"));
  EXPECT_THAT(notes, HasSubstr("node 1 \"other\", and 1 other: it is not of the scene that the "
                               "file shows, and is left out"));
}

// Regression: files without a camera were seen as in a mirror.
TEST(GltfReaderTest, OurOwnCameraSeesRightOnTheRight) {
  const auto read = Read(File(kOneNode));
  ASSERT_TRUE(read.ok()) << read.status();
  const Matrix4& matrix = read->scene.camera.world_from_camera.start;
  EXPECT_GT(matrix.m[0][0], 0.8);  // x, seen from the front.
  EXPECT_GT(matrix.m[1][1], 0.8);  // y, up.
  EXPECT_LT(matrix.m[2][2], -0.8);
}

// A file with variants or shaders has materials of the core format beside them; some exporters call
// the extension required.
TEST(GltfReaderTest, ChoicesShowTheDefaultMaterials) {
  for (const std::string name : {"KHR_materials_variants", "KHR_techniques_webgl",
                                 "EXT_structural_metadata", "CESIUM_RTC"}) {
    const auto read = Read(
        File(absl::StrCat(R"("materials": [{}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}],
        "extensionsUsed": [")",
                          name, R"("], "extensionsRequired": [")", name, "\"]")));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_THAT(Notes(*read), HasSubstr("the extension " + name + " has no effect"));
  }
}

TEST(GltfReaderTest, CamerasAndLights) {
  const std::string rest = R"("materials": [{}], "cameras": [
    {"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1, "aspectRatio": 2}},
    {"name": "Top", "type": "orthographic",
      "orthographic": {"xmag": 4, "ymag": 2, "znear": 0, "zfar": 9}}],
    "extensions": {"KHR_lights_punctual": {"lights": [
      {"type": "spot", "intensity": 40, "color": [1, 0.5, 0],
        "spot": {"outerConeAngle": 0.5, "innerConeAngle": 0.25}}]}},
    "nodes": [{"mesh": 0}, {"camera": 0}, {"camera": 1, "translation": [0, 0, 5]},
      {"translation": [0, 3, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}}],
    "scenes": [{"nodes": [0, 1, 2, 3]}])";
  auto read = Read(File(rest));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->scene.film.width_px, 1440);
  EXPECT_NEAR(read->scene.camera.fov_degrees, 0.8 * 57.29578, 1e-4);
  ASSERT_EQ(read->scene.lights.size(), 1u);
  const auto& spot = std::get<SpotLight>(read->scene.lights[0].light);
  EXPECT_EQ(spot.intensity.rgb, (Rgb{40, 20, 0}));
  EXPECT_EQ(spot.to.z, -1);
  EXPECT_NEAR(spot.cone_delta_angle_degrees, 0.25 * 57.29578, 1e-4);
  GltfView top, tip;
  top.camera = "Top";
  top.height_px = 100;
  tip.camera = "Tip";
  read = Read(File(rest), top);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->scene.camera.kind, CameraDescription::Kind::kOrthographic);
  EXPECT_EQ(read->scene.camera.screen_window[1], 4);
  EXPECT_EQ(read->scene.film.width_px, 200);
  EXPECT_THAT(Read(File(rest), tip).status().message(), HasSubstr("did you mean \"Top\""));
}

TEST(GltfReaderTest, TwoCamerasAreTheEyesOfAStereoFrame) {
  const auto file = [](const std::string& right, const std::string& angle = "0.8") {
    return File(absl::StrCat(R"("materials": [{}], "cameras": [
      {"name": "L", "type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}},
      {"name": "R", "type": "perspective", "perspective": {"znear": 0.1, "yfov": )",
                             angle, R"(}}],
      "nodes": [{"mesh": 0}, {"camera": 0, "translation": [1, 2, 5]}, {"camera": 1, )",
                             right, R"(}], "scenes": [{"nodes": [0, 1, 2]}])"));
  };
  GltfView eyes;
  eyes.camera = "L";
  eyes.right_camera = "R";
  const auto read = Read(file(R"("translation": [1.0625, 2, 5])"), eyes);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->eye_distance, 0.0625f);
  EXPECT_DOUBLE_EQ(read->scene.camera.world_from_camera.start.m[0][3], 1.03125);
  EXPECT_DOUBLE_EQ(read->scene.camera.world_from_camera.end.m[0][3], 1.03125);
  EXPECT_DOUBLE_EQ(read->scene.camera.world_from_camera.start.m[1][3], 2);
  const auto why_not = [&](const std::string& text) {
    return std::string(Read(text, eyes).status().message());
  };
  for (const std::string& text :
       {file(R"("translation": [0.9, 2, 5])"), file(R"("translation": [1.1, 2.1, 5])"),
        file(R"("translation": [1.1, 2, 5], "rotation": [0, 0.1, 0, 0.995])"),
        file(R"("translation": [1.1, 2, 5])", "0.9")}) {
    EXPECT_THAT(why_not(text), HasSubstr("are not two eyes"));
  }
  eyes.right_camera = "Right";
  EXPECT_THAT(why_not(file(R"("translation": [1.1, 2, 5])")),
              HasSubstr("there is no camera \"Right\""));
  EXPECT_EQ(Read(file(R"("translation": [1.1, 2, 5])"))->eye_distance, 0);
}

std::string FileWithImage(const std::string& uri) {
  return File(absl::StrCat(R"("images": [{"uri": ")", uri, R"("}], "textures": [{"source": 0}],
    "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}])"));
}

std::string FileWithBuffer(const std::string& uri) {
  return absl::StrCat(R"({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": ")",
                      uri, R"("}]})");
}

std::string WithAccessor(const std::string& accessor) {
  const std::string last = R"("type": "VEC4"})";
  return absl::StrReplaceAll(kAccessors, {{last, absl::StrCat(last, ", ", accessor)}});
}

// An accessor of one sparse value claims 12 GB from two kilobytes.
TEST(GltfReaderTest, ContentFitsTheBytesOfTheFiles) {
  const std::string file =
      File(R"("nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}])",
           R"("meshes": [{"primitives": [{"attributes": {"POSITION": 6}}]}],)",
           WithAccessor(R"({"componentType": 5126, "count": 1000000000, "type": "VEC3", "sparse":
        {"count": 1, "indices": {"bufferView": 2, "componentType": 5123},
         "values": {"bufferView": 0}}})"));
  EXPECT_THAT(std::string(Read(file).status().message()), HasSubstr("expansion_factor 256 times"));
  EXPECT_TRUE(absl::IsResourceExhausted(Read(file).status()));
}

// 20,000 nodes that show a mesh of 20,000 primitives: 4e8 placements by 2 MB.
TEST(GltfReaderTest, PlacementsAreBounded) {
  std::string nodes, roots, primitives;
  for (int i = 0; i < 20'000; ++i) {
    const char* const comma = i > 0 ? "," : "";
    absl::StrAppend(&nodes, comma, R"({"mesh": 0})");
    absl::StrAppend(&roots, comma, i);
    absl::StrAppend(&primitives, comma, R"({"attributes": {"POSITION": 0}})");
  }
  const std::string file =
      File(absl::StrCat(R"("nodes": [)", nodes, R"(], "scenes": [{"nodes": [)", roots, "]}]"),
           absl::StrCat(R"("meshes": [{"primitives": [)", primitives, "]}],"));
  SceneReaderLimits limits;
  limits.placements_max = 100'000;
  EXPECT_THAT(std::string(Read(file, {}, limits).status().message()),
              HasSubstr("more often than the limit of 100000 (placements_max)"));
}

// Each of 200 nodes has the same skin of 2000 joints.
TEST(GltfReaderTest, SkinsAreReadOnce) {
  std::string nodes, roots, joints;
  for (int i = 0; i < 200; ++i) {
    absl::StrAppend(&nodes, i > 0 ? "," : "", R"({"mesh": 0, "skin": 0})");
    absl::StrAppend(&roots, i > 0 ? "," : "", i);
  }
  for (int i = 0; i < 2000; ++i) absl::StrAppend(&joints, i > 0 ? "," : "", i % 200);
  const std::string file =
      File(absl::StrCat(R"("materials": [{}], "nodes": [)", nodes,
                        R"(], "skins": [{"inverseBindMatrices": 6, "joints": [)", joints,
                        R"(]}], "scenes": [{"nodes": [)", roots, "]}]"),
           kMesh, WithAccessor(R"({"componentType": 5126, "count": 2000, "type": "MAT4"})"));
  SceneReaderLimits limits;
  limits.memory_bytes_max = 4 << 20;  // The skin takes a seventh.
  EXPECT_TRUE(Read(file, {}, limits).ok()) << Read(file, {}, limits).status();
}

TEST(GltfReaderTest, RefusesByName) {
  std::string four = kAccessors;
  four.replace(four.find("\"count\": 3"), 10, "\"count\": 4");
  const struct {
    std::string text, message;
  } cases[] = {
      {"{}", "not valid glTF"},
      {R"({"asset": {"version": "1.1"}, "meshes": {"m": {}}})",
       "a.gltf: is glTF 1.0, Sheaf reads 2.0"},
      {R"({"buffers": {}, "meshes": {"m": {}}})", "a.gltf: is glTF 1.0, Sheaf reads 2.0"},
      {std::string(4000, '['), "nests JSON"},
      {"glTF", "too short"},
      {std::string("glTF\x01\0\0\0\x14\0\0\0\0\0\0\0JSON", 20), "is glTF 1.0, Sheaf reads 2.0"},
      {File(R"("materials": [{}], "nodes": [{"mesh": 7}], "scenes": [{"nodes": [0]}])"), "mesh 7"},
      {File(R"("nodes": [{"children": [1]}, {"children": [0]}])"), "within itself"},
      {File(R"("nodes": [{"children": [2]}, {"children": [2]}, {}])"), "child of two"},
      {File(R"("nodes": [{"children": [9]}])"), "does not exist"},
      {File(R"("nodes": [{"mesh": 0}], "extensionsUsed": ["ACME_x"],
        "extensionsRequired": ["ACME_x"])"),
       "needs the extension ACME_x"},
      {File(R"("nodes": [{"mesh": 0}], "extensionsUsed": ["ACME_x", "ACME_y"],
        "extensionsRequired": ["ACME_x", "ACME_y"])"),
       "needs the extensions ACME_x and ACME_y, which Sheaf does not support"},
      {File(kOneNode,
            R"("meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 7}]}],)"),
       "has the mode 7, which is none of 0 to 6"},
      {File(R"("materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": "rock.ktx2"}], "nodes": [{"mesh": 0}])"),
       "image 0 is in KTX2"},
      {R"({"techniques": {"t": {}}})", "a.gltf: is glTF 1.0, Sheaf reads 2.0"},
      {File(kOneNode, kMesh, four), "has 4 elements, more than buffer view 0"},
      {File(R"("materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}],
        "nodes": [{"mesh": 0}])"),
       "KHR_texture_basisu"},
      {FileWithImage("../secret.png"), "\"../secret.png\" lies outside of the scene's folder"},
      {FileWithImage("%2e%2e/secret.png"), "lies outside of the scene's folder"},
      {FileWithImage("in/../../secret.png"), "lies outside of the scene's folder"},
      {FileWithImage("/secret.png"), "lies outside of the scene's folder"},
      {FileWithBuffer("../secret.txt"), "lies outside of the scene's folder"},
      {FileWithBuffer("%2Fsecret.txt"), "lies outside of the scene's folder"},
  };
  for (const auto& [text, message] : cases) {
    const auto read = Read(text);
    ASSERT_FALSE(read.ok()) << message;
    EXPECT_THAT(read.status().message(), HasSubstr(message));
    EXPECT_THAT(read.status().message(), HasSubstr("a.gltf: ")) << message;
  }
}

}  // namespace
}  // namespace sheaf
