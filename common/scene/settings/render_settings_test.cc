// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/render_settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/scene/file_source.h"
#include "common/scene/settings/frame_settings_fields.h"

namespace sheaf {
namespace {

TEST(RenderSettingsTest, SceneProvidesMissingSettings) {
  SceneDescription scene;
  scene.film.width_px = 100;
  scene.film.height_px = 50;
  scene.sampling.samples_per_pixel = 64;
  scene.sampling.max_depth = 7;
  scene.sampling.seed = 3;
  const auto from_scene = ResolveSettings(scene, {});
  ASSERT_TRUE(from_scene.ok());
  EXPECT_EQ(from_scene->window, (PixelRect{0, 0, 100, 50}));
  EXPECT_EQ(from_scene->samples, 64u);
  EXPECT_EQ(from_scene->max_depth, 7);
  EXPECT_EQ(from_scene->seed, 3u);
  RenderSettings asked;
  asked.samples = 5;
  asked.max_depth = 0;
  asked.seed = 9;
  asked.similarity_after = 3;
  asked.light_samples = 8;
  const auto resolved = ResolveSettings(scene, asked);
  ASSERT_TRUE(resolved.ok());
  EXPECT_EQ(resolved->samples, 5u);
  EXPECT_EQ(resolved->max_depth, 0);
  EXPECT_EQ(resolved->seed, 9u);
  EXPECT_EQ(from_scene->similarity_after, 0);
  EXPECT_EQ(resolved->similarity_after, 3);
  EXPECT_EQ(from_scene->light_samples, 0);
  EXPECT_EQ(resolved->light_samples, 8);
}

TEST(RenderSettingsTest, TechniquesAreThoseOfTheIntegratorUnlessRequested) {
  const std::pair<const char*, TechniqueSet> cases[] = {
      {"bdpt", TechniqueSet::kCameraAndLight}, {"mlt", TechniqueSet::kCameraAndLight},
      {"sppm", TechniqueSet::kCameraAndLight.With(Technique::kMerging)},
      {"lightpath", TechniqueSet::kLight},     {"path", TechniqueSet::kCamera},
      {"volpath", TechniqueSet::kCamera},      {"randomwalk", TechniqueSet::kCamera},
      {"", TechniqueSet::kCamera},
  };
  for (const auto& [integrator, expected] : cases) {
    SceneDescription scene;
    scene.sampling.integrator = integrator;
    EXPECT_EQ(ResolveSettings(scene, {})->techniques, expected) << integrator;
    for (const std::string& name : TechniquesNames()) {
      RenderSettings asked;
      asked.techniques = *TechniqueSet::Parse(name);
      const absl::StatusOr<FrameSettings> settings = ResolveSettings(scene, asked);
      // Only paths from the camera alone are shared or mutated, or have chains.
      const TechniqueSet others = asked.techniques->Without(Technique::kSharing);
      const bool shares_others =
          SharesPaths(*asked.techniques) && !(others == TechniqueSet::kCamera);
      const bool mutates_others = MutatesPaths(*asked.techniques) &&
                                  !(*asked.techniques == TechniqueSet{Technique::kMutations});
      const bool chains_others =
          HasChains(*asked.techniques) && !(*asked.techniques == TechniqueSet{Technique::kChains});
      if (shares_others || mutates_others || chains_others) {
        EXPECT_EQ(settings.status().code(), absl::StatusCode::kInvalidArgument) << name;
        continue;
      }
      ASSERT_TRUE(settings.ok()) << settings.status();
      EXPECT_EQ(settings->techniques.Name(), name) << integrator;
    }
  }
}

TEST(RenderSettingsTest, CropsRoundUpAndIntersect) {
  SceneDescription scene;
  scene.film.width_px = 10;
  scene.film.height_px = 10;
  const double crop[4] = {0.25, 0.75, 0, 0.31};
  std::copy(std::begin(crop), std::end(crop), scene.film.crop_window);
  EXPECT_EQ(ResolveSettings(scene, {})->window, (PixelRect{3, 0, 8, 4}));
  RenderSettings asked;
  asked.crop = PixelRect{5, 2, 100, 100};
  EXPECT_EQ(ResolveSettings(scene, asked)->window, (PixelRect{5, 2, 8, 4}));
  asked.crop = PixelRect{8, 0, 10, 10};
  EXPECT_EQ(ResolveSettings(scene, asked).status().code(), absl::StatusCode::kInvalidArgument);
  scene.film.has_pixel_bounds = true;
  const int32_t bounds[4] = {-5, 4, 6, 60};
  std::copy(std::begin(bounds), std::end(bounds), scene.film.pixel_bounds);
  EXPECT_EQ(ResolveSettings(scene, {})->window, (PixelRect{0, 6, 4, 10}));
}

TEST(RenderSettingsTest, ImpossibleSettingsAreRefused) {
  SceneDescription scene;
  RenderSettings asked;
  asked.samples = 0;
  EXPECT_FALSE(ResolveSettings(scene, asked).ok());
  asked = {};
  asked.max_depth = -1;
  EXPECT_FALSE(ResolveSettings(scene, asked).ok());
  for (const int32_t after : {-1, kSimilarityAfterMax + 1}) {
    asked = {};
    asked.similarity_after = after;
    EXPECT_THAT(std::string(ResolveSettings(scene, asked).status().message()),
                ::testing::HasSubstr(absl::StrCat("similarity after ", after, " scatterings")));
  }
  for (const int32_t count : {-1, 0, kLightSamplesMax + 1}) {
    asked = {};
    asked.light_samples = count;
    EXPECT_THAT(std::string(ResolveSettings(scene, asked).status().message()),
                ::testing::HasSubstr(absl::StrCat(count, " light samples at a vertex")));
  }
  scene.film.width_px = scene.film.height_px = 2000000;
  EXPECT_THAT(std::string(ResolveSettings(scene, {}).status().message()),
              ::testing::HasSubstr("exceeds the limit"));
  scene.film.width_px = 0;
  EXPECT_FALSE(ResolveSettings(scene, {}).ok());
}

TEST(RenderSettingsTest, DigestCoversOnlySettingsThatChangeSamples) {
  FrameSettings settings;
  settings.width_px = settings.height_px = 8;
  settings.window = {0, 0, 8, 8};
  const std::string digest = FrameDigest("scene", settings, "profile");
  EXPECT_TRUE(IsSha256Hex(digest));
  FrameSettings generic = settings;
  generic.force_generic_variant = true;
  EXPECT_EQ(FrameDigest("scene", generic, "profile"), digest);
  FrameSettings more = settings;
  more.samples = 17;
  EXPECT_EQ(FrameDigest("scene", more, "profile"), digest);
  std::vector<FrameSettings> others(22, settings);
  others[0].width_px = 9;
  others[1].height_px = 9;
  others[2].window.x0 = 1;
  others[3].window.y1 = 7;
  others[4].single_scattering = true;
  others[5].max_depth = 6;
  others[6].seed = 1;
  others[7].primaries = Primaries::kAcesCg;
  others[8].white_balance_k = 5000;
  others[9].similarity_after = 1;
  others[10].similarity_after = 2;
  others[11].lattice.stride_px = 8;
  others[12].sensor = "nikon_d850";
  others[13].max_component_value = 10;
  others[14].techniques = TechniqueSet::kCameraAndLight;
  others[15].techniques = TechniqueSet::kLight;
  others[16].techniques = TechniqueSet::kCameraGuided;
  others[17].techniques = TechniqueSet::kCameraAndLightGuided;
  others[18].light_samples = 2;
  others[19].light_samples = 8;
  others[20].eye_distance = 0.1f;
  others[21].eye_convergence = 2;
  for (const FrameSettings& other : others)
    EXPECT_NE(FrameDigest("scene", other, "profile"), digest);
  EXPECT_NE(FrameDigest("scene", others[9], "profile"),
            FrameDigest("scene", others[10], "profile"));
  EXPECT_NE(FrameDigest("scene", others[14], "profile"),
            FrameDigest("scene", others[15], "profile"));
  EXPECT_NE(FrameDigest("scene", others[14], "profile"),
            FrameDigest("scene", others[17], "profile"));
  EXPECT_NE(FrameDigest("scene", others[16], "profile"),
            FrameDigest("scene", others[17], "profile"));
  EXPECT_NE(FrameDigest("scene", others[18], "profile"),
            FrameDigest("scene", others[19], "profile"));
  EXPECT_NE(FrameDigest("other", settings, "profile"), digest);
  EXPECT_NE(FrameDigest("scene", settings, "other"), digest);
}

// Does not compile where settings get another field, lest it lacks its description.
TEST(RenderSettingsTest, EveryFieldIsDescribed) {
  const FrameSettings settings;
  [[maybe_unused]] const auto& [width_px, height_px, window, samples, max_depth, seed, color,
                                single_scattering, one_sequence, similarity_after, light_samples,
                                techniques, eye_distance, eye_convergence, force_generic_variant,
                                lattice, outputs, sensor, max_component_value, primaries,
                                white_balance_k] = settings;
  std::set<std::string> names;
  std::set<const void*> members;
  VisitFrameSettings(settings, [&](const SettingField& field, const auto& member) {
    names.insert(field.name);
    members.insert(&member);
  });
  EXPECT_EQ(names.size(), 21u);
  EXPECT_EQ(members.size(), 21u);
}

// Parts, stored jobs and images are known by digests of this text.
TEST(RenderSettingsTest, DigestTextsKeepTheirBytes) {
  EXPECT_EQ(FrameDigestText("scene", FrameSettings(), "profile"),
            "sheaf-frame 3\n"
            "scene scene\n"
            "size_px 0 0\n"
            "window_px 0 0 0 0\n"
            "max_depth 5\n"
            "seed 0\n"
            "color auto\n"
            "scattering full\n"
            "profile profile\n");
  EXPECT_EQ(FrameDigest("scene", FrameSettings(), "profile"),
            "0a7299cfa91c71d9a18e37a635bc94292561f6443fd661247939a9521ea1ac1b");
  FrameSettings settings;
  settings.width_px = 640;
  settings.height_px = 480;
  settings.window = {1, 2, 300, 400};
  settings.max_depth = 17;
  settings.seed = ~uint64_t{0};
  settings.color = ColorTransport::kSpectral;
  settings.single_scattering = true;
  settings.one_sequence = true;
  settings.similarity_after = 12;
  settings.light_samples = 8;
  settings.techniques = TechniqueSet::kCameraAndLight;
  settings.lattice = {8, settings.seed};
  settings.outputs.Add(Aov::kPosition);
  settings.outputs.Add(Aov::kMotion);
  settings.outputs.camera_space = true;
  settings.primaries = Primaries::kAcesCg;
  settings.white_balance_k = 5600.25f;
  settings.sensor = "nikon_d850";
  settings.max_component_value = 12.5f;
  EXPECT_EQ(FrameDigestText("scene", settings, "profile"),
            "sheaf-frame 3\n"
            "scene scene\n"
            "size_px 640 480\n"
            "window_px 1 2 300 400\n"
            "max_depth 17\n"
            "seed 18446744073709551615\n"
            "color spectral\n"
            "scattering single\n"
            "sampling one-sequence\n"
            "similarity_after 12\n"
            "pixel_stride_px 8\n"
            "outputs position,motion,space:camera\n"
            "primaries acescg\n"
            "white_balance_k 5600.25\n"
            "sensor nikon_d850\n"
            "max_component_value 12.5\n"
            "techniques camera+light\n"
            "light_samples_max 8\n"
            "profile profile\n");
}

TEST(RenderSettingsTest, OutputsCombineSceneAndFlags) {
  SceneDescription scene;
  EXPECT_TRUE(ResolveSettings(scene, {})->outputs.empty());
  scene.film.outputs.Add(Aov::kUv);
  scene.lights.resize(2);
  scene.lights[1].group = "key";
  scene.area_lights.resize(1);
  scene.area_lights[0].group = "key";
  RenderSettings asked;
  asked.outputs.Add(Aov::kMotion);
  EXPECT_EQ(FormatOutputs(ResolveSettings(scene, asked)->outputs), "uv,motion");
  asked.light_groups = true;
  EXPECT_EQ(FormatOutputs(ResolveSettings(scene, asked)->outputs),
            "uv,motion,light:default,light:key");
  scene.camera.kind = CameraDescription::Kind::kEqualArea;
  EXPECT_EQ(ResolveSettings(scene, asked).status().code(), absl::StatusCode::kInvalidArgument);
  asked.outputs = {};
  EXPECT_TRUE(ResolveSettings(scene, asked).ok());
  scene.lights.resize(kLightGroupsMax + 1);
  for (size_t i = 0; i < scene.lights.size(); ++i) scene.lights[i].group = std::to_string(i);
  EXPECT_EQ(ResolveSettings(scene, asked).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(RenderSettingsTest, DigestIncludesOutputsIfAny) {
  FrameSettings settings;
  EXPECT_EQ(FrameDigestText("scene", settings, "profile").find("outputs"), std::string::npos);
  const std::string digest = FrameDigest("scene", settings, "profile");
  settings.outputs.Add(Aov::kUv);
  EXPECT_NE(FrameDigest("scene", settings, "profile"), digest);
  EXPECT_THAT(FrameDigestText("scene", settings, "profile"),
              ::testing::HasSubstr("\noutputs uv\nprofile profile\n"));
}

TEST(RenderSettingsTest, DigestIncludesBiasIfAny) {
  FrameSettings settings;
  EXPECT_EQ(FrameDigestText("scene", settings, "profile").find("similarity"), std::string::npos);
  settings.similarity_after = 8;
  EXPECT_THAT(FrameDigestText("scene", settings, "profile"),
              ::testing::HasSubstr("\nsimilarity_after 8\nprofile profile\n"));
}

// Parts of earlier versions stay valid.
TEST(RenderSettingsTest, DigestIncludesTechniquesBesideThoseOfTheCamera) {
  FrameSettings settings;
  settings.techniques = TechniqueSet::kCamera;
  EXPECT_EQ(FrameDigestText("scene", settings, "profile").find("techniques"), std::string::npos);
  EXPECT_EQ(FrameDigest("scene", settings, "profile"),
            FrameDigest("scene", FrameSettings(), "profile"));
  settings.techniques = TechniqueSet::kLight;
  EXPECT_THAT(FrameDigestText("scene", settings, "profile"),
              ::testing::HasSubstr("\ntechniques light\nprofile profile\n"));
  settings.techniques = TechniqueSet::kCameraGuided;
  EXPECT_THAT(FrameDigestText("scene", settings, "profile"),
              ::testing::HasSubstr("\ntechniques camera+guiding\nprofile profile\n"));
}

TEST(RenderSettingsTest, EnergyCompensationIsReportedOnceWithItsFlag) {
  SceneDescription scene;
  scene.materials.push_back({"", DiffuseMaterial(), {}});
  scene.materials.push_back({"", ConductorMaterial(), {}});
  EXPECT_EQ(ComparisonNote(scene, {}), "");
  std::get<ConductorMaterial>(scene.materials[1].material).roughness.v.value = 0.1f;
  EXPECT_THAT(ComparisonNote(scene, {}), ::testing::HasSubstr("--single-scattering"));
  scene.materials[1].material = CoatedDiffuseMaterial();
  EXPECT_NE(ComparisonNote(scene, {}), "");
  FrameSettings as_in_pbrt;
  as_in_pbrt.single_scattering = true;
  EXPECT_EQ(ComparisonNote(scene, as_in_pbrt), "");
}

TEST(RenderSettingsTest, ProfileNamesBuildAndInstructionSet) {
  EXPECT_THAT(
      NumericProfile(),
      ::testing::MatchesRegex("[^ ]+ sheaf-[0-9.]+ [a-z]+-[0-9]+ embree-[0-9.]+ build-[0-9a-f]+"));
}

TEST(FileSourceTest, NamesAreCanonical) {
  const std::pair<const char*, const char*> cases[] = {
      {"a.ply", "a.ply"},    {"./a.ply", "a.ply"},       {"x/../a.ply", "a.ply"},
      {"x//y/./a", "x/y/a"}, {"../s/a", "../s/a"},       {"../../a", "../../a"},
      {"x/../../a", "../a"}, {"/abs/../a", "/abs/../a"}, {"", ""},
  };
  for (const auto& [reference, expected] : cases) EXPECT_EQ(CanonicalFileName(reference), expected);
}

TEST(FileSourceTest, NotFoundErrorsNameTheFile) {
  const std::map<std::string, std::string> paths = {{"a", "/there"}};
  TableFileSource table(paths);
  EXPECT_EQ(*table.LocalPath("a"), "/there");
  EXPECT_EQ(table.LocalPath("b").status().code(), absl::StatusCode::kNotFound);
  DirectoryFileSource directory(::testing::TempDir());
  EXPECT_THAT(std::string(directory.LocalPath("no-such-file").status().message()),
              ::testing::HasSubstr("file \"no-such-file\" does not exist"));
  EXPECT_TRUE(directory.FilesUsed().empty());
}

}  // namespace
}  // namespace sheaf
