// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests that small files cannot make the reader take much time or memory.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/scene/pbrt/scene_reader.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

class SceneReaderLimitsTest : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ + "/" + name, std::ios::binary) << text;
  }
  absl::StatusOr<ReadSceneResult> Read(const std::string& text,
                                       const SceneReaderLimits& limits = {}) {
    Write("main.pbrt", text);
    DirectoryFileSource files(folder_);
    return ReadScene("main.pbrt", files, limits);
  }

  const std::string folder_ =
      absl::StrCat(::testing::TempDir(), "/scene_reader_limits_",
                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(SceneReaderLimitsTest, ErrorsNameLimits) {
  SceneReaderLimits limits;
  limits.memory_bytes_max = 64;
  const std::string mesh = std::string("WorldBegin\nShape \"trianglemesh\" ") +
                           "\"integer indices\" [0 1 2] \"point3 P\" [0 0 0 1 0 0 0 1 0]\n";
  EXPECT_THAT(std::string(Read(mesh, limits).status().message()), HasSubstr("memory_bytes_max"));
  EXPECT_EQ(Read(mesh, limits).status().code(), absl::StatusCode::kResourceExhausted);
  limits = {};
  limits.triangles_max = 0;
  EXPECT_THAT(std::string(Read(mesh, limits).status().message()), HasSubstr("triangles_max"));
  limits = {};
  limits.file_bytes_max = 20;
  EXPECT_THAT(std::string(Read(mesh, limits).status().message()), HasSubstr("file_bytes_max"));
  limits = {};
  limits.include_depth_max = 1;
  Write("a.pbrt", "Include \"b.pbrt\"\n");
  Write("b.pbrt", "Include \"c.pbrt\"\n");
  Write("c.pbrt", "");
  EXPECT_THAT(std::string(Read("WorldBegin\nInclude \"a.pbrt\"\n", limits).status().message()),
              HasSubstr("a.pbrt:1:1: files are nested deeper than the limit of 1"));
}

// Each level includes the next one twice: 2^29 inclusions by 1.7 kB of files.
TEST_F(SceneReaderLimitsTest, IncludesThatDoubleAreBounded) {
  constexpr int kLevels = 29;
  for (int i = 0; i < kLevels; ++i) {
    const std::string next = absl::StrCat("Include \"", i + 1, ".pbrt\"\n");
    Write(absl::StrCat(i, ".pbrt"), next + next);
  }
  Write(absl::StrCat(kLevels, ".pbrt"), "# Nothing.\n");
  const std::string scene = "WorldBegin\nInclude \"0.pbrt\"\n";
  EXPECT_THAT(std::string(Read(scene).status().message()),
              HasSubstr("included more often than the limit of 100000 (inclusions_max)"));
  SceneReaderLimits limits;
  limits.repeated_bytes_max = 1000;
  EXPECT_THAT(std::string(Read(scene, limits).status().message()),
              HasSubstr("more than the limit of 1000 bytes (repeated_bytes_max)"));
}

std::string Repeated(const std::string& line, int count) {
  std::string text = "WorldBegin\n";
  for (int i = 0; i < count; ++i)
    absl::StrAppend(&text, absl::StrReplaceAll(line, {{"$", absl::StrCat(i)}}), "\n");
  return text;
}

// Each line of a small file may name a large one.
TEST_F(SceneReaderLimitsTest, FilesNamedAgainAreBounded) {
  std::string spectrum, ies = "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 37 1 1 2 0 0 0\n1 1 100\n";
  for (int i = 0; i < 100; ++i) absl::StrAppend(&spectrum, 360 + i, " .5\n");
  for (int i = 0; i <= 180; i += 5) absl::StrAppend(&ies, i, " ");
  absl::StrAppend(&ies, "\n0\n");
  for (int i = 0; i <= 180; i += 5) absl::StrAppend(&ies, 100, " ");
  Write("a.spd", spectrum);
  Write("a.ies", ies);
  Write("a.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  SceneReaderLimits limits;
  limits.repeated_bytes_max = 2000;
  for (const char* const line :
       {"Material \"diffuse\" \"spectrum reflectance\" \"a.spd\"",
        "LightSource \"point\" \"spectrum I\" \"a.spd\"",
        "MakeNamedMedium \"$\" \"string type\" \"homogeneous\" \"spectrum sigma_a\" \"a.spd\"",
        "LightSource \"goniometric\" \"string filename\" \"a.ies\""}) {
    EXPECT_TRUE(Read(Repeated(line, 3), limits).ok()) << Read(Repeated(line, 3), limits).status();
    EXPECT_THAT(std::string(Read(Repeated(line, 50), limits).status().message()),
                HasSubstr("more than the limit of 2000 bytes (repeated_bytes_max)"))
        << line;
  }
  // A mesh is read once for each list of steps.
  const std::string shape = "Shape \"plymesh\" \"string filename\" \"a.ply\"";
  EXPECT_TRUE(Read(Repeated(shape, 50), limits).ok());
  std::string steps = Repeated(shape, 1);
  for (int count = 1; count <= 6; ++count) {
    absl::StrAppend(&steps, shape);
    for (int i = 1; i <= count; ++i)
      absl::StrAppend(&steps, " \"string filename", i, "\" \"a.ply\"");
    absl::StrAppend(&steps, "\n");
  }
  EXPECT_THAT(std::string(Read(steps, limits).status().message()),
              HasSubstr("more than the limit of 2000 bytes (repeated_bytes_max)"));
}

TEST_F(SceneReaderLimitsTest, FilesThatHaveNoEndAreNotRead) {
  ASSERT_EQ(::mkfifo((folder_ + "/pipe.pbrt").c_str(), 0600), 0);
  EXPECT_THAT(std::string(Read("WorldBegin\nInclude \"pipe.pbrt\"\n").status().message()),
              HasSubstr("main.pbrt:2:1: cannot read \"pipe.pbrt\": file \"pipe.pbrt\" is a pipe"));
  EXPECT_THAT(std::string(Read("WorldBegin\nInclude \"/dev/zero\"\n").status().message()),
              HasSubstr("is a device, not a regular file"));
}

// Levels of mixes whose parts are one mix each: 2^levels paths lead to the last one.
std::string SharedMixes(int levels) {
  std::string text = "WorldBegin\nMakeNamedMaterial \"0\" \"string type\" \"diffuse\"\n";
  for (int i = 1; i <= levels; ++i) {
    absl::StrAppend(&text, "MakeNamedMaterial \"", i, "\" \"string type\" \"mix\" ",
                    "\"string materials\" [\"", i - 1, "\" \"", i - 1, "\"]\n");
  }
  return text;
}

TEST_F(SceneReaderLimitsTest, SharedMixesAreWalkedOnce) {
  EXPECT_EQ(Read(SharedMixes(60))->scene.materials.size(), 61u);
  EXPECT_THAT(std::string(Read(SharedMixes(100'000)).status().message()),
              HasSubstr("mix materials are nested 65 deep, more than the limit of 64"));
}

}  // namespace
}  // namespace sheaf
