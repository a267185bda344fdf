// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/option_parameters.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/scene/pbrt/scene_reader.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

absl::StatusOr<ReadSceneResult> Read(const std::string& text) {
  const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::string folder = ::testing::TempDir() + "sheaf-options-" + info->name();
  EXPECT_TRUE(MakeDirectories(folder).ok());
  EXPECT_TRUE(WriteFileAtomically(folder + "/main.pbrt", text).ok());
  DirectoryFileSource files(folder);
  return ReadScene("main.pbrt", files);
}

struct IntegratorCase {
  std::string name;
  TechniqueSet techniques = TechniqueSet::kCamera;
  std::vector<std::pair<std::string, std::string>> unused = {};  // "bool samplebsdf", "true".
};
std::vector<IntegratorCase> OtherIntegrators() {
  return {
      {"bdpt",
       TechniqueSet::kCameraAndLight,
       {{"bool visualizestrategies", "true"}, {"bool visualizeweights", "false"}}},
      {"mlt",
       TechniqueSet::kCameraAndLight,
       {{"integer bootstrapsamples", "9"},
        {"integer chains", "9"},
        {"integer mutationsperpixel", "9"},
        {"float largestepprobability", "0.5"},
        {"float sigma", "0.5"}}},
      {"sppm",
       TechniqueSet::kCameraAndLight.With(Technique::kMerging),
       {{"integer photonsperiteration", "9"}, {"float radius", "0.5"}, {"integer seed", "9"}}},
      {"lightpath", TechniqueSet::kLight},
      {"simplepath",
       TechniqueSet::kCamera,
       {{"bool samplelights", "false"}, {"bool samplebsdf", "true"}}},
      {"simplevolpath"},
      {"randomwalk"},
  };
}

// Parameters that say how an integrator works have no effect, not even on the seed.
TEST(OptionParametersTest, IntegratorsAreReadAsTechniques) {
  for (const auto& [name, techniques, unused] : OtherIntegrators()) {
    SCOPED_TRACE(name);
    std::string text =
        absl::StrCat("# A comment.\n  Integrator \"", name, "\" \"integer maxdepth\" 11");
    for (const auto& [parameter, value] : unused) {
      absl::StrAppend(&text, "\n\"", parameter, "\" ", value);
    }
    const auto read = Read(text + "\nWorldBegin\n");
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->scene.sampling.seed, 0u);
    const auto settings = ResolveSettings(read->scene, {});
    ASSERT_TRUE(settings.ok()) << settings.status();
    EXPECT_EQ(settings->techniques, techniques);
    EXPECT_EQ(settings->max_depth, 11);
    std::string notes;
    for (const SceneDiagnostic& note : read->diagnostics) {
      EXPECT_EQ(note.severity, SceneDiagnostic::Severity::kNote) << note.text;
      absl::StrAppend(&notes, note.text, "\n");
    }
    EXPECT_EQ(read->diagnostics.size(), 1 + unused.size()) << notes;
    EXPECT_THAT(notes,
                HasSubstr(absl::StrCat("main.pbrt:2:3: integrator \"", name,
                                       "\" is read as --techniques ", techniques.Name(), ": ")));
    for (size_t i = 0; i < unused.size(); ++i) {
      const std::string& parameter = unused[i].first;
      const std::string word = parameter.substr(parameter.find(' ') + 1);
      EXPECT_THAT(notes, HasSubstr(absl::StrCat("main.pbrt:", 3 + i, ":1: integrator \"", name,
                                                "\": parameter \"", word, "\" has no effect")));
    }
  }
}

TEST(OptionParametersTest, ParametersThatPbrtRefusesAreRefused) {
  for (const char* wrong :
       {"\"bdpt\" \"integer chains\" 4", "\"mlt\" \"float chains\" 4",
        "\"sppm\" \"bool samplebsdf\" true", "\"lightpath\" \"float radius\" 1"}) {
    const auto read = Read(absl::StrCat("Integrator ", wrong, "\nWorldBegin\n"));
    EXPECT_THAT(std::string(read.status().message()), HasSubstr("main.pbrt:1:")) << wrong;
  }
}

}  // namespace
}  // namespace sheaf
