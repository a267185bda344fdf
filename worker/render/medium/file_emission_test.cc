// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/file_emission.h"

#include <string>
#include <vector>

#include "common/base/file.h"
#include "common/scene/file_source.h"
#include "gtest/gtest.h"
#include "tests/support/temporary_path.h"
#include "tests/support/volume/volume_writers.h"

namespace sheaf::render {
namespace {

using ::sheaf::testing::NvdbCodec;
using ::sheaf::testing::NvdbFile;

// Whether the medium of a file with these grids emits.
bool Emits(const std::vector<std::string>& grids, const std::string& temperature_grid) {
  const std::string path = sheaf::testing::TemporaryPath("smoke");
  std::vector<sheaf::testing::GridToWrite> written;
  for (const std::string& name : grids) {
    written.push_back({.name = name, .value = [](const sheaf::testing::Voxel&) { return 1.0f; }});
  }
  EXPECT_TRUE(WriteFileAtomically(path, NvdbFile(written, NvdbCodec::kNone)).ok());
  TableFileSource files{{{"smoke.nvdb", path}}};
  SceneDescription scene;
  VolumeFileMedium volume;
  volume.file = "smoke.nvdb";
  if (!temperature_grid.empty()) volume.temperature_grid = temperature_grid;
  MediumDescription medium;
  medium.emits = true;
  medium.kind = volume;
  scene.media.push_back(medium);
  ResolveFileEmission(files, &scene);
  return scene.media[0].emits;
}

TEST(FileEmissionTest, AFileWithoutTemperaturesIsDark) {
  EXPECT_FALSE(Emits({"density"}, ""));
  EXPECT_TRUE(Emits({"density", "temperature"}, ""));
}

// Reading the grid reports that it is missing.
TEST(FileEmissionTest, AGridThatTheSceneNamesStays) {
  EXPECT_TRUE(Emits({"density"}, "heat"));
  EXPECT_TRUE(Emits({"density", "heat"}, "heat"));
}

TEST(FileEmissionTest, AMissingFileChangesNothing) {
  TableFileSource files{{}};
  SceneDescription scene;
  MediumDescription medium;
  medium.emits = true;
  VolumeFileMedium volume;
  volume.file = "none.nvdb";
  medium.kind = volume;
  scene.media.push_back(medium);
  ResolveFileEmission(files, &scene);
  EXPECT_TRUE(scene.media[0].emits);
}

}  // namespace
}  // namespace sheaf::render
