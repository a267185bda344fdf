// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/gltf/gltf_inputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <string>

#include "common/base/file.h"
#include "common/scene/spectrum/primaries.h"
#include "tests/support/image_files.h"
#include "tests/support/temporary_path.h"

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;

// An equirectangular image of 8 x 4 pixels, all of them 2 except the upper half, which is 6.
std::string Panorama() {
  std::string bytes = "PF\n8 4\n-1.0\n";
  for (int row = 0; row < 4; ++row) {  // From the bottom.
    for (int i = 0; i < 24; ++i) {
      const float value = row < 2 ? 2 : 6;
      bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
  }
  const std::string path = ::testing::TempDir() + "/sky.pfm";
  EXPECT_TRUE(WriteFileOnce(path, bytes).ok());
  return path;
}

TEST(GltfInputsTest, FramesAreTimes) {
  GltfArguments arguments;
  arguments.fps = 10;
  EXPECT_EQ(ViewOf(arguments, {}, 1).time_s, 0);
  EXPECT_EQ(ViewOf(arguments, {}, 6).time_s, 0.5);
  EXPECT_EQ(ViewOf(arguments, {}, 6).shutter_s, 0.05);
}

TEST(GltfInputsTest, AddsViewAndEnvironment) {
  GltfArguments arguments;
  arguments.environment = Panorama();
  GltfInputs inputs(arguments, {});
  DirectoryFileSource files(::testing::TempDir(), inputs.derived());
  ASSERT_TRUE(inputs.Add("a.glb", 3, &files).ok());
  const auto view = DecodeGltfView(*ReadWholeFile(*files.LocalPath("a.glb.view")));
  ASSERT_TRUE(view.ok()) << view.status();
  EXPECT_EQ(*view, [&] {
    GltfView expected = ViewOf(arguments, {}, 3);
    expected.environment = "a.glb.environment.pfm";
    return expected;
  }());
  const std::string map = *ReadWholeFile(*files.LocalPath(view->environment));
  const std::string header = "PF\n16 16\n-1.0\n";
  ASSERT_EQ(map.substr(0, header.size()), header);
  ASSERT_EQ(map.size(), header.size() + 16 * 16 * 12);
  double sum = 0;
  for (size_t i = header.size(); i < map.size(); i += 4) {
    float value = 0;
    std::memcpy(&value, map.data() + i, 4);
    EXPECT_TRUE(value >= 2 && value <= 6) << value;
    sum += static_cast<double>(value) / (16 * 16 * 3);
  }
  EXPECT_NEAR(sum, 4, 0.05);  // Areas stay equal.
}

TEST(GltfInputsTest, EnvironmentsAreInThePrimariesOfTheirHeader) {
  const std::string path = sheaf::testing::TemporaryPath("sky.exr");
  const std::array<float, 8> rec2020{.708f, .292f, .17f, .797f, .131f, .046f, .3127f, .329f};
  ASSERT_TRUE(WriteFileOnce(
                  path, sheaf::testing::ExrBytes({.width = 8,
                                                  .height = 4,
                                                  .channels = {{"R", .5f}, {"G", .4f}, {"B", .3f}},
                                                  .chromaticities = rec2020}))
                  .ok());
  const absl::StatusOr<std::string> map = EqualAreaEnvironment(path);
  ASSERT_TRUE(map.ok()) << map.status();
  Rgb texel;
  std::memcpy(&texel, map->data() + map->size() - sizeof texel, sizeof texel);
  const Rgb expected =
      SrgbFromPrimaries({.5f, .4f, .3f}, Primaries::kRec2020, ColorRole::kIlluminant);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(texel[c], expected[c], 1e-3f);
}

TEST(GltfInputsTest, LeavesOtherScenesAlone) {
  GltfArguments arguments;
  arguments.camera = "Main";
  GltfInputs none({}, {}), some(arguments, {});
  DirectoryFileSource files(::testing::TempDir(), none.derived());
  EXPECT_TRUE(none.Add("a.pbrt", 1, &files).ok());
  EXPECT_TRUE(files.FilesUsed().empty());
  EXPECT_THAT(some.Add("a.pbrt", 1, &files).message(), HasSubstr("--camera"));
}

}  // namespace
}  // namespace sheaf::cli
