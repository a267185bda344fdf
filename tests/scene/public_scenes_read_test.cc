// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Public scenes are read, or fail for the expected reason. The scenes are not part of the
// repository: SHEAF_PUBLIC_SCENES names the folder of the collection; without it the tests are
// skipped.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "common/scene/pbrt/scene_reader.h"

namespace sheaf {
namespace {

struct PublicScene {
  const char* path;
  size_t triangle_count;  // If it can be read.
  const char* error;      // Part of the message if it cannot be read; otherwise nullptr.
};

constexpr PublicScene kScenes[] = {
    {"cornell-box/cornell-box.pbrt", 32, nullptr},
    {"cornell-box/cornell-box-small.pbrt", 32, nullptr},
    {"cornell-box/cornell-box-silver.pbrt", 32, nullptr},
    {"cornell-box/cornell-box-specular.pbrt", 22, nullptr},
    {"cornell-box/cornell-box-specular-small.pbrt", 22, nullptr},
    {"cornell-box/cornell-box-specular-volume.pbrt", 22, nullptr},
    {"cornell-box/smallpt.pbrt", 10, nullptr},
    {"cornell-box/volumetric-caustic.pbrt", 12, nullptr},
    {"cornell-box/cornell-box-environment-map.pbrt", 2, nullptr},
    {"killeroos/killeroo-simple.pbrt", 66532, nullptr},
    {"killeroos/killeroo-simple-small.pbrt", 66532, nullptr},
    {"killeroos/killeroo-moving-small.pbrt", 66532, nullptr},
    {"killeroos/killeroo-gold.pbrt", 532230, nullptr},
    {"killeroos/killeroo-coated-gold.pbrt", 532230, nullptr},
    {"material-testball/material-testball-small.pbrt", 80770, nullptr},
    {"material-testball/material-testball-sequence.pbrt", 80770, nullptr},
    {"material-testball/sequence.pbrt", 0, "the scene has no WorldBegin"},
    {"material-testball/volumes.pbrt", 0, "the scene has no WorldBegin"},
    {"staircase2/staircase2-small.pbrt", 30927, nullptr},
    {"teapot-cloud/teapot_cloud-small.pbrt", 12, nullptr},
    {"veach-mis/veach-mis-small.pbrt", 12, nullptr},
    {"veach-mis/veach-mis-colorized.pbrt", 12, nullptr},
    {"volumetric-caustic/volumetric-caustic.pbrt", 14, nullptr},
};

void ExpectScene(const std::filesystem::path& folder, const PublicScene& expected) {
  const std::filesystem::path path = folder / expected.path;
  DirectoryFileSource files(path.parent_path().string());
  const absl::StatusOr<ReadSceneResult> result = ReadScene(path.filename().string(), files);
  if (expected.error != nullptr) {
    ASSERT_FALSE(result.ok());
    EXPECT_THAT(std::string(result.status().message()), ::testing::HasSubstr(expected.error));
    return;
  }
  ASSERT_TRUE(result.ok()) << result.status().message();
  size_t triangle_count = 0;
  for (const TriangleMesh& mesh : result->scene.meshes) triangle_count += mesh.indices.size() / 3;
  EXPECT_EQ(triangle_count, expected.triangle_count);
}

TEST(PublicScenesReadTest, ScenesReadOrReportAReason) {
  const char* folder = std::getenv("SHEAF_PUBLIC_SCENES");
  if (folder == nullptr) {
    GTEST_SKIP() << "SHEAF_PUBLIC_SCENES is not set: the comparison with public scenes is skipped";
  }
  for (const PublicScene& scene : kScenes) {
    SCOPED_TRACE(scene.path);
    ExpectScene(folder, scene);
  }
}

}  // namespace
}  // namespace sheaf
