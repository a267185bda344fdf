// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scenes for tests, written as text of scene files.
#pragma once

#include <fstream>
#include <string>

#include "common/base/file.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "gtest/gtest.h"

namespace sheaf::testing {

// The scene of a file with this text, which must be valid.
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
