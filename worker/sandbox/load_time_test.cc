// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "worker/sandbox/sandboxed_scenes.h"

namespace sheaf::worker {
namespace {

TEST(LoadTimeForTest, FollowsTheBytesOfTheScene) {
  const std::string path = ::testing::TempDir() + "/load_time_for_scene.pbrt";
  std::ofstream(path) << "WorldBegin\n";
  SceneInputs inputs;
  inputs.local_paths = {{"a.pbrt", path}, {"lost.ply", path + ".lost"}};
  EXPECT_LT(LoadTimeFor(inputs), absl::Seconds(121));
  std::filesystem::resize_file(path, 600'000'000);
  EXPECT_EQ(LoadTimeFor(inputs), absl::Seconds(720));
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace sheaf::worker
