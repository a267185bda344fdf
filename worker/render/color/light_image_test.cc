// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/color/light_image.h"

#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "common/image/image_io.h"

namespace sheaf::render {
namespace {

TEST(LightImageTest, ImagesReadAgainAreBounded) {
  const std::string path = ::testing::TempDir() + "/light_image_test.png";
  ASSERT_TRUE(WritePng(path, 10, 10, std::vector<Rgb8>(100)).ok());
  SceneDescription scene;
  scene.files = {"main.pbrt"};
  TableFileSource files({{"a.png", path}, {"b.png", path}});
  LightImages images(scene, files, /*repeated_texels_max=*/150);
  for (const char* const file : {"a.png", "b.png", "a.png", "a.png"}) {
    EXPECT_TRUE(images.Read({0, 1, 1}, file).ok()) << file;
  }
  const absl::Status status = images.Read({0, 7, 1}, "b.png").status();
  EXPECT_TRUE(absl::IsResourceExhausted(status));
  EXPECT_EQ(status.message().find("main.pbrt:7:1: images that were read for other lights"), 0u)
      << status;
}

TEST(LightImageTest, ErrorsSayWhereAndWhatToDo) {
  const std::string path = ::testing::TempDir() + "/light_image_test_broken.png";
  std::ofstream(path) << "no image";
  SceneDescription scene;
  scene.files = {"main.pbrt"};
  TableFileSource files({{"sky.png", path}});
  const absl::Status status = ReadLightImage(scene, {0, 7, 1}, "sky.png", files).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_EQ(status.message().find("main.pbrt:7:1: sky.png: "), 0u) << status;
  EXPECT_NE(status.message().find("; replace the file or remove it"), std::string::npos) << status;
}

}  // namespace
}  // namespace sheaf::render
