// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scenes of tests that are written as a scene file is.
#pragma once

#include <fstream>
#include <string>

#include "common/base/file.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "gtest/gtest.h"

namespace sheaf::testing {

// The scene of a file of this text, which must be one.
inline SceneDescription ReadSceneText(const std::string& text) {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::string directory = ::testing::TempDir() + "sheaf-scene-text-" + test->name();
  EXPECT_TRUE(MakeDirectories(directory).ok());
  std::ofstream(directory + "/main.pbrt") << text;
  DirectoryFileSource files(directory);
  absl::StatusOr<ReadSceneResult> result = ReadScene("main.pbrt", files);
  EXPECT_TRUE(result.ok()) << result.status();
  return result.ok() ? std::move(result->scene) : SceneDescription();
}

}  // namespace sheaf::testing
