// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/scene_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "common/base/file.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

void WriteText(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

// A scene whose files are given by the test.
class SceneReaderTest : public ::testing::Test {
 protected:
  void Write(const std::string& name, const std::string& text) {
    const std::string path = Directory() + "/" + name;
    ASSERT_TRUE(MakeDirectories(path.substr(0, path.rfind('/'))).ok());
    WriteText(path, text);
  }
  static std::string Directory() {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    return ::testing::TempDir() + "sheaf-" + info->test_suite_name() + "-" + info->name();
  }
  absl::StatusOr<ReadSceneResult> Read(const std::string& text,
                                       const SceneReaderLimits& limits = {}) {
    Write("main.pbrt", text);
    DirectoryFileSource files(Directory());
    return ReadScene("main.pbrt", files, limits);
  }
  SceneDescription ReadGood(const std::string& text) {
    absl::StatusOr<ReadSceneResult> result = Read(text);
    EXPECT_TRUE(result.ok()) << result.status().message();
    if (!result.ok()) return {};
    notes_ = result->diagnostics;
    return std::move(result->scene);
  }
  void ExpectNote(SceneDiagnostic::Severity severity, const std::string& text) {
    for (const SceneDiagnostic& note : notes_) {
      if (note.severity == severity && note.text.find(text) != std::string::npos) return;
    }
    ADD_FAILURE() << "no diagnostic says: " << text;
  }
  std::vector<SceneDiagnostic> notes_;
};

constexpr const char* kTriangle =
    "\"point3 P\" [0 0 0  1 0 0  0 1 0] \"integer indices\" [0 1 2]\n";

TEST_F(SceneReaderTest, EmptyWorldHasPbrtDefaults) {
  const SceneDescription scene = ReadGood("WorldBegin\n");
  EXPECT_EQ(scene.film.width_px, 1280);
  EXPECT_EQ(scene.film.height_px, 720);
  EXPECT_EQ(scene.film.exposure_scale, 1);
  EXPECT_EQ(scene.filter.kind, FilterDescription::Kind::kGaussian);
  EXPECT_EQ(scene.filter.radius_x_px, 1.5f);
  EXPECT_EQ(scene.filter.sigma, 0.5f);
  EXPECT_EQ(scene.sampling.sampler, "zsobol");
  EXPECT_EQ(scene.sampling.samples_per_pixel, 16);
  EXPECT_EQ(scene.sampling.integrator, "volpath");
  EXPECT_EQ(scene.sampling.max_depth, 5);
  EXPECT_EQ(scene.camera.fov_degrees, 90);
  EXPECT_DOUBLE_EQ(scene.camera.screen_window[1], 1280.0 / 720);
  EXPECT_DOUBLE_EQ(scene.camera.screen_window[3], 1);
}

TEST_F(SceneReaderTest, LookAtPlacesTheCamera) {
  const SceneDescription scene = ReadGood(
      "Scale -1 1 1\nLookAt 1 2 3  1 2 4  0 1 0\n"
      "Camera \"perspective\" \"float fov\" 30 \"float shutterclose\" 0.25\n"
      "Film \"rgb\" \"integer xresolution\" 100 \"integer yresolution\" 200 \"float iso\" 200\n"
      "WorldBegin\n");
  // camera_from_world = Scale * LookAt, so the camera's x is mirrored and its place unchanged.
  const Matrix4& m = scene.camera.world_from_camera.start;
  const Vec3d eye = TransformPoint(m, {0, 0, 0});
  EXPECT_NEAR(eye.x, 1, 1e-12);
  EXPECT_NEAR(eye.y, 2, 1e-12);
  EXPECT_NEAR(eye.z, 3, 1e-12);
  EXPECT_NEAR(TransformVector(m, {0, 0, 1}).z, 1, 1e-12);
  EXPECT_NEAR(TransformVector(m, {1, 0, 0}).x, -1, 1e-12);
  EXPECT_DOUBLE_EQ(scene.camera.screen_window[1], 1);
  EXPECT_DOUBLE_EQ(scene.camera.screen_window[3], 2);
  EXPECT_FLOAT_EQ(scene.film.exposure_scale, 2.f);  // ISO 200, whatever the shutter.
}

TEST_F(SceneReaderTest, SphericalCamerasHaveAMapping) {
  const std::string sphere = "Camera \"spherical\"";
  EXPECT_EQ(ReadGood(sphere + "\nWorldBegin\n").camera.kind, CameraDescription::Kind::kEqualArea);
  const SceneDescription scene = ReadGood(
      sphere +
      " \"string mapping\" \"equirectangular\" \"float lensradius\" 0\n"
      "\"float focaldistance\" 3 \"float screenwindow\" [0 1 0 1] \"float shutterclose\" 0.5\n"
      "WorldBegin\n");
  EXPECT_EQ(scene.camera.kind, CameraDescription::Kind::kEquirectangular);
  EXPECT_EQ(scene.camera.lens_radius, 0);
  EXPECT_EQ(scene.camera.shutter_close, 0.5f);
  ExpectNote(SceneDiagnostic::Severity::kNote, "main.pbrt:2:1: camera \"spherical\": parameter");
  ExpectNote(SceneDiagnostic::Severity::kNote, "\"screenwindow\" has no effect");
}

TEST_F(SceneReaderTest, AttributesNestAndTransformsCompose) {
  const SceneDescription scene = ReadGood(
      std::string(
          "WorldBegin\nTranslate 1 0 0\nAttributeBegin\nScale 2 2 2\nReverseOrientation\n"
          "Material \"dielectric\"\nShape \"sphere\"\nAttributeEnd\nShape \"trianglemesh\" ") +
      kTriangle);
  ASSERT_EQ(scene.shapes.size(), 2u);
  EXPECT_EQ(TransformPoint(scene.shapes[0].world_from_object.start, {1, 0, 0}), (Vec3d{3, 0, 0}));
  EXPECT_TRUE(scene.shapes[0].reverse_orientation);
  EXPECT_FALSE(scene.shapes[1].reverse_orientation);
  EXPECT_TRUE(std::holds_alternative<DielectricMaterial>(
      scene.materials[static_cast<size_t>(scene.shapes[0].material)].material));
  EXPECT_TRUE(std::holds_alternative<DiffuseMaterial>(
      scene.materials[static_cast<size_t>(scene.shapes[1].material)].material));
}

TEST_F(SceneReaderTest, ActiveTransformSetsOneShutterEnd) {
  const SceneDescription scene = ReadGood(
      "TransformTimes 0 2\nWorldBegin\nActiveTransform EndTime\nTranslate 0 0 5\nActiveTransform "
      "All\n"
      "Shape \"disk\" \"float radius\" 2\n");
  const TransformOverTime& moving = scene.shapes.at(0).world_from_object;
  EXPECT_TRUE(moving.IsAnimated());
  EXPECT_EQ(TransformPoint(moving.start, {0, 0, 0}).z, 0);
  EXPECT_EQ(TransformPoint(moving.end, {0, 0, 0}).z, 5);
  EXPECT_EQ(moving.end_time, 2);
}

TEST_F(SceneReaderTest, ObjectInstancesKeepBothTransforms) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nObjectBegin \"o\"\nTranslate 1 0 0\nAreaLightSource \"diffuse\"\nShape "
      "\"sphere\"\n"
      "ObjectEnd\nTranslate 0 7 0\nObjectInstance \"o\"\n");
  ASSERT_EQ(scene.instances.size(), 1u);
  EXPECT_TRUE(scene.world_shapes.empty());
  EXPECT_EQ(scene.objects.at(0).shapes, std::vector<int32_t>{0});
  EXPECT_EQ(TransformPoint(scene.shapes[0].world_from_object.start, {0, 0, 0}), (Vec3d{1, 0, 0}));
  EXPECT_EQ(TransformPoint(scene.instances[0].world_from_instance.start, {0, 0, 0}),
            (Vec3d{0, 7, 0}));
  EXPECT_EQ(scene.shapes[0].area_light, kNone);
  ExpectNote(SceneDiagnostic::Severity::kWarning,
             "main.pbrt:5:1: shapes of an object emit no light");
}

TEST_F(SceneReaderTest, DiffuseTransmissionDefaults) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nMaterial \"diffusetransmission\"\nShape \"sphere\"\n"
      "Material \"diffusetransmission\" \"rgb reflectance\" [0.5 0.25 1] "
      "\"rgb transmittance\" [0.5 0.25 0.5] \"float scale\" 0.75\nShape \"sphere\"\n");
  const auto sheet = [&](size_t shape) {
    return std::get<DiffuseTransmissionMaterial>(
        scene.materials[static_cast<size_t>(scene.shapes.at(shape).material)].material);
  };
  EXPECT_EQ(sheet(0).reflectance.value.rgb, Rgb::Gray(0.25f));
  EXPECT_EQ(sheet(0).transmittance.value.rgb, Rgb::Gray(0.25f));
  EXPECT_EQ(sheet(0).scale, 1);
  EXPECT_EQ(sheet(1).transmittance.value.rgb, (Rgb{0.5f, 0.25f, 0.5f}));
  EXPECT_EQ(sheet(1).scale, 0.75f);
  ExpectNote(
      SceneDiagnostic::Severity::kWarning,
      "main.pbrt:4:1: material \"diffusetransmission\": reflectance and transmittance add up "
      "to 1.125");
}

TEST_F(SceneReaderTest, ReadsNormalAndBumpMaps) {
  Write("n.png", "x");
  const SceneDescription scene = ReadGood(
      "WorldBegin\nTexture \"h\" \"float\" \"constant\" \"float value\" 0.1\n"
      "MakeNamedMaterial \"tiles\" \"string type\" \"conductor\" \"string normalmap\" \"./n.png\"\n"
      "Material \"diffuse\" \"texture displacement\" \"h\"\n"
      "AreaLightSource \"diffuse\" \"string filename\" \"n.png\"\nShape \"sphere\"\n");
  ASSERT_EQ(scene.materials.size(), 2u);
  ASSERT_NE(scene.materials[0].normal_map, kNone);
  EXPECT_EQ(scene.materials[0].name, "tiles");
  const TextureDescription& map = scene.textures[scene.materials[0].normal_map];
  EXPECT_TRUE(map.is_color);
  EXPECT_EQ(std::get<ImageTexture>(map.texture).file, "n.png");
  EXPECT_EQ(std::get<ImageTexture>(map.texture).encoding, ColorEncoding::kLinear);
  EXPECT_EQ(scene.materials[1].normal_map, kNone);
  ASSERT_NE(scene.materials[1].displacement.texture, kNone);
  EXPECT_EQ(scene.textures[scene.materials[1].displacement.texture].name, "h");
  EXPECT_EQ(scene.area_lights.at(0).file, "n.png");
}

TEST_F(SceneReaderTest, ColorSpaceIsAnAttribute) {
  const SceneDescription scene = ReadGood(
      "ColorSpace \"rec2020\"\nFilm \"rgb\"\nWorldBegin\n"
      "LightSource \"point\" \"rgb I\" [1 1 1]\n"
      "AttributeBegin\nColorSpace \"aces2065-1\"\nLightSource \"point\" \"rgb I\" [1 1 1]\n"
      "Attribute \"material\" \"rgb reflectance\" [0.5 0.5 0.5]\nAttributeEnd\n"
      "Material \"diffuse\" \"rgb reflectance\" [0 1 0]\nShape \"sphere\"\n"
      "Material \"diffuse\" \"rgb reflectance\" [0.4 0.5 0.3]\nShape \"sphere\"\n"
      "ColorSpace \"srgb\"\nMaterial \"diffuse\" \"rgb reflectance\" [0 1 0]\n"
      "Shape \"sphere\"\n");
  const auto light = [&](size_t i) {
    return std::get<PointLight>(scene.lights.at(i).light).intensity.rgb;
  };
  EXPECT_NEAR(light(0).b, 1, 1e-5);
  EXPECT_NEAR(light(1).b, 0.9155, 4e-3);
  const auto reflectance = [&](size_t shape) {
    return std::get<DiffuseMaterial>(
               scene.materials[static_cast<size_t>(scene.shapes.at(shape).material)].material)
        .reflectance.value;
  };
  EXPECT_EQ(reflectance(0).rgb,
            (Rgb{0, 1, 0}));  // Clamped; the true color is outside of the gamut.
  EXPECT_TRUE(reflectance(0).is_out_of_gamut);
  EXPECT_NEAR(reflectance(0).true_rgb.r, -0.5876, 2e-3);
  EXPECT_FALSE(reflectance(1).is_out_of_gamut);
  EXPECT_NEAR(reflectance(1).rgb.g, 0.5 + 0.1 * 0.1246 + 0.2 * 0.0083, 2e-3);
  EXPECT_FALSE(reflectance(2).is_out_of_gamut);
  ExpectNote(SceneDiagnostic::Severity::kNote, "\"reflectance\" is outside the gamut of sRGB");
}

TEST_F(SceneReaderTest, CoatedConductorsHaveTwoRoughnesses) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nMaterial \"coatedconductor\"\nShape \"sphere\"\n"
      "Material \"coatedconductor\" \"float interface.roughness\" 0.1 "
      "\"float interface.eta\" 1.3 \"float conductor.uroughness\" 0.2 "
      "\"float conductor.vroughness\" 0.3 \"rgb reflectance\" [0.5 0.25 1] "
      "\"float thickness\" 0.5 \"bool remaproughness\" false \"float g\" 0.5 "
      "\"rgb albedo\" [0 0 0] \"integer maxdepth\" 5 \"integer nsamples\" 2\n"
      "Shape \"sphere\"\n");
  const auto coated = [&](size_t shape) {
    return std::get<CoatedConductorMaterial>(
        scene.materials[static_cast<size_t>(scene.shapes.at(shape).material)].material);
  };
  EXPECT_EQ(coated(0).eta, 1.5f);
  EXPECT_EQ(coated(0).thickness, 0.01f);
  EXPECT_EQ(coated(0).roughness.u.value, 0);
  EXPECT_EQ(coated(0).conductor.roughness.u.value, 0);
  EXPECT_EQ(coated(0).conductor.eta.value.name, "metal-Cu-eta");
  EXPECT_FALSE(coated(0).conductor.has_reflectance);
  EXPECT_EQ(coated(1).eta, 1.3f);
  EXPECT_EQ(coated(1).roughness.v.value, 0.1f);
  EXPECT_EQ(coated(1).conductor.roughness.u.value, 0.2f);
  EXPECT_EQ(coated(1).conductor.roughness.v.value, 0.3f);
  EXPECT_FALSE(coated(1).conductor.roughness.remap_roughness);
  EXPECT_TRUE(coated(1).conductor.has_reflectance);
  EXPECT_EQ(coated(1).conductor.reflectance.value.rgb, (Rgb{0.5f, 0.25f, 1}));
}

TEST_F(SceneReaderTest, NamedMaterialsMayBeDefinedLater) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nNamedMaterial \"late\"\nShape \"sphere\"\n"
      "MakeNamedMaterial \"late\" \"string type\" \"mix\" \"string materials\" [\"a\" \"b\"]\n"
      "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"texture reflectance\" \"t\"\n"
      "MakeNamedMaterial \"b\" \"string type\" \"conductor\" \"texture eta\" \"t\"\n"
      "Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [0.1 0.2 0.3]\n");
  const auto& mix = std::get<MixMaterial>(
      scene.materials[static_cast<size_t>(scene.shapes.at(0).material)].material);
  const auto& a =
      std::get<DiffuseMaterial>(scene.materials[static_cast<size_t>(mix.material[0])].material);
  const auto& b =
      std::get<ConductorMaterial>(scene.materials[static_cast<size_t>(mix.material[1])].material);
  ASSERT_NE(a.reflectance.texture, kNone);
  // A texture used in two roles becomes two textures.
  EXPECT_NE(a.reflectance.texture, b.eta.texture);
  EXPECT_EQ(scene.textures[static_cast<size_t>(b.eta.texture)].role, ColorRole::kUnbounded);
  EXPECT_EQ(std::get<ConstantTexture>(scene.textures[static_cast<size_t>(b.eta.texture)].texture)
                .color.rgb.g,
            0.2f);
}

TEST_F(SceneReaderTest, UnnamedMaterialsThatAreWrittenAlikeAreKnown) {
  Write("glass.pbrt", "Material \"dielectric\" \"float eta\" 1.4\nShape \"sphere\"\n");
  const SceneDescription scene = ReadGood(
      "WorldBegin\nMaterial \"dielectric\" \"float eta\" 1.5\nShape \"sphere\"\n"
      "Include \"glass.pbrt\"\nInclude \"glass.pbrt\"\n"
      "Attribute \"material\" \"float roughness\" .1\nInclude \"glass.pbrt\"\n"
      "MakeNamedMaterial \"b\" \"string type\" \"dielectric\"\nNamedMaterial \"b\"\n"
      "Shape \"sphere\"\n");
  const auto first_alike = [&](size_t shape) {
    return scene.materials[static_cast<size_t>(scene.shapes.at(shape).material)].first_alike;
  };
  EXPECT_EQ(first_alike(0), scene.shapes[0].material);
  EXPECT_EQ(first_alike(1), scene.shapes[1].material);
  EXPECT_EQ(first_alike(2), scene.shapes[1].material);
  EXPECT_EQ(first_alike(3), scene.shapes[3].material);
  EXPECT_EQ(first_alike(4), kNone);
}

TEST_F(SceneReaderTest, AttributeDefaultsMayBeUnused) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nAttribute \"shape\" \"float radius\" 3\nShape \"sphere\"\n"
      "Shape \"sphere\" \"float radius\" 4\nShape \"trianglemesh\" " +
      std::string(kTriangle));
  EXPECT_EQ(std::get<SphereShape>(scene.shapes.at(0).shape).radius, 3);
  EXPECT_EQ(std::get<SphereShape>(scene.shapes.at(1).shape).radius, 4);
}

TEST_F(SceneReaderTest, ReadsCylinders) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nShape \"cylinder\"\nShape \"cylinder\" \"float radius\" 2 \"float zmin\" 3 "
      "\"float zmax\" -4 \"float phimax\" 400\n");
  const auto& whole = std::get<CylinderShape>(scene.shapes.at(0).shape);
  EXPECT_EQ(whole.radius, 1);
  EXPECT_EQ(whole.z_min, -1);
  EXPECT_EQ(whole.z_max, 1);
  EXPECT_EQ(whole.phi_max_degrees, 360);
  const auto& other = std::get<CylinderShape>(scene.shapes.at(1).shape);
  EXPECT_EQ(other.radius, 2);
  EXPECT_EQ(other.z_min, -4);
  EXPECT_EQ(other.z_max, 3);
  EXPECT_EQ(other.phi_max_degrees, 360);
}

TEST_F(SceneReaderTest, ReadsBilinearMeshes) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nShape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]\n"
      "Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1 2 0 0 2 1 0]\n"
      "\"integer indices\" [0 1 2 3 1 4 3 5] \"point2 uv\" [0 0 1 0 0 1 1 1 2 0 2 1]\n"
      "\"normal N\" [0 0 1 0 0 1 0 0 1 0 0 1 0 0 1 0 0 1]\n");
  ASSERT_EQ(scene.bilinear_meshes.size(), 2u);
  EXPECT_EQ(std::get<BilinearMeshShape>(scene.shapes.at(1).shape).mesh, 1);
  EXPECT_EQ(scene.bilinear_meshes[0].indices, (std::vector<uint32_t>{0, 1, 2, 3}));
  EXPECT_TRUE(scene.bilinear_meshes[0].uvs.empty());
  const BilinearMesh& two = scene.bilinear_meshes[1];
  EXPECT_EQ(two.positions.size(), 6u);
  EXPECT_EQ(two.indices, (std::vector<uint32_t>{0, 1, 2, 3, 1, 4, 3, 5}));
  EXPECT_EQ(two.uvs.size(), 6u);
  EXPECT_EQ(two.normals.size(), 6u);
}

TEST_F(SceneReaderTest, IncludeKeepsStateAndImportDoesNot) {
  Write("sub/state.pbrt", "Translate 5 0 0\nCoordinateSystem \"there\"\n");
  const SceneDescription included =
      ReadGood("WorldBegin\nInclude \"sub/state.pbrt\"\nShape \"sphere\"\n");
  EXPECT_EQ(TransformPoint(included.shapes.at(0).world_from_object.start, {0, 0, 0}).x, 5);
  EXPECT_EQ(included.files, (std::vector<std::string>{"main.pbrt", "sub/state.pbrt"}));
  const SceneDescription imported =
      ReadGood("WorldBegin\nImport \"sub/state.pbrt\"\nShape \"sphere\"\n");
  EXPECT_EQ(TransformPoint(imported.shapes.at(0).world_from_object.start, {0, 0, 0}).x, 0);
  const auto lost = Read("WorldBegin\nImport \"sub/state.pbrt\"\nCoordSysTransform \"there\"\n");
  EXPECT_THAT(std::string(lost.status().message()), HasSubstr("main.pbrt:3:1: coordinate system"));
}

TEST_F(SceneReaderTest, ReadsLightsAndSpectra) {
  Write("a.spd", "400 1\n800 1 # flat\n");
  const SceneDescription scene = ReadGood(
      "WorldBegin\nLightSource \"point\" \"blackbody I\" 6500 \"float power\" 60 \"point3 from\" "
      "[1 2 3]\n"
      "LightSource \"distant\" \"spectrum L\" [400 2 800 2] \"float illuminance\" 10\n"
      "LightSource \"spot\" \"spectrum I\" \"stdillum-D65\" \"float coneangle\" 20\n"
      "LightSource \"infinite\"\n"
      "AreaLightSource \"diffuse\" \"spectrum L\" \"a.spd\" \"bool twosided\" true \"float scale\" "
      "2\n"
      "Shape \"sphere\"\n");
  ASSERT_EQ(scene.lights.size(), 4u);
  const auto& point = std::get<PointLight>(scene.lights[0].light);
  EXPECT_EQ(point.from, (Vec3d{1, 2, 3}));
  EXPECT_EQ(scene.lights[0].scale.power_w, 60);
  EXPECT_NEAR(Luminance(point.intensity.rgb), 1, 1e-3);
  EXPECT_EQ(std::get<DistantLight>(scene.lights[1].light).illuminance_lx, 10);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(std::get<SpotLight>(scene.lights[2].light).intensity.rgb[i], 1, 1e-5);
    EXPECT_EQ(std::get<InfiniteLight>(scene.lights[3].light).radiance.rgb[i], 1);
  }
  EXPECT_TRUE(scene.area_lights.at(0).two_sided);
  EXPECT_EQ(scene.area_lights.at(0).scale.scale, 2);
  EXPECT_EQ(scene.shapes.at(0).area_light, 0);
}

TEST_F(SceneReaderTest, ReadsImageLights) {
  Write("slides/a.png", "");
  const SceneDescription scene = ReadGood(
      "WorldBegin\n"
      "LightSource \"projection\" \"string filename\" \"slides/./a.png\" \"float fov\" 30\n"
      "LightSource \"goniometric\" \"rgb I\" [1 2 3] \"float power\" 7 \"float scale\" 2\n");
  ASSERT_EQ(scene.lights.size(), 2u);
  const auto& projection = std::get<ProjectionLight>(scene.lights[0].light);
  EXPECT_EQ(projection.file, "slides/a.png");
  EXPECT_EQ(projection.fov_degrees, 30);
  EXPECT_EQ(std::get<GoniometricLight>(scene.lights[1].light).intensity.rgb, (Rgb{1, 2, 3}));
  EXPECT_EQ(scene.lights[1].scale.power_w, 7);
  EXPECT_EQ(scene.lights[1].scale.scale, 2);
  ExpectNote(SceneDiagnostic::Severity::kWarning, "main.pbrt:3:1: light \"goniometric\": without");
}

TEST_F(SceneReaderTest, MeshFilesAreLoadedOnce) {
  Write("m.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  const SceneDescription scene = ReadGood(
      "WorldBegin\nShape \"plymesh\" \"string filename\" \"m.ply\"\n"
      "Shape \"plymesh\" \"string filename\" [\"./x/../m.ply\"] \"float alpha\" 0.5\n");
  ASSERT_EQ(scene.meshes.size(), 1u);
  EXPECT_EQ(scene.meshes[0].file, "m.ply");
  EXPECT_TRUE(scene.shapes.at(1).has_alpha);
  EXPECT_EQ(scene.shapes.at(1).alpha.value, 0.5f);
}

TEST_F(SceneReaderTest, MissingMainFileIsNotFound) {
  DirectoryFileSource files(Directory());
  EXPECT_EQ(ReadScene("gone.pbrt", files).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(SceneReaderTest, ErrorsAreCollectedUpToTheLimit) {
  std::string text = "WorldBegin\n";
  for (int i = 0; i < 10; ++i) text += "Shape \"cone\"\n";
  SceneReaderLimits limits;
  limits.errors_max = 3;
  const std::string message(Read(text, limits).status().message());
  EXPECT_THAT(message, HasSubstr("main.pbrt:2:1: shape \"cone\""));
  EXPECT_THAT(message, HasSubstr("main.pbrt:4:1: shape \"cone\""));
  EXPECT_THAT(message, ::testing::Not(HasSubstr("main.pbrt:5:1")));
  EXPECT_THAT(message, HasSubstr("reading stopped after 3 errors"));
}

TEST_F(SceneReaderTest, LongInlineMeshesCrossBufferBoundaries) {
  // About 2 MB, so that numbers cross the ends of the reader's buffer at many offsets.
  constexpr int kVertexCount = 60000;
  std::string text = "WorldBegin Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point3 P\" [";
  for (int i = 0; i < kVertexCount; ++i) {
    text += std::to_string(i) + ".25 -" + std::to_string(i * 7 % 1000) + "e-3\t+1.5\n # comment\n";
  }
  const SceneDescription scene = ReadGood(text + "]");
  ASSERT_EQ(scene.meshes.at(0).positions.size(), static_cast<size_t>(kVertexCount));
  for (int i = 0; i < kVertexCount; ++i) {
    const Vec3f p = scene.meshes[0].positions[static_cast<size_t>(i)];
    ASSERT_EQ(p.x, static_cast<float>(i) + 0.25f);
    ASSERT_EQ(p.y, -static_cast<float>(i * 7 % 1000 * 1e-3));
    ASSERT_EQ(p.z, 1.5f);
  }
}

}  // namespace
}  // namespace sheaf
