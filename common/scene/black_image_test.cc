// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/black_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "common/scene/pbrt/scene_reader.h"
#include "tests/support/temporary_path.h"

namespace sheaf {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string WhyBlackOf(const std::string& world) {
  const std::string path = testing::TemporaryPath("room.pbrt");
  std::ofstream(path) << "Camera \"perspective\"\nWorldBegin\n" << world;
  TableFileSource files({{"room.pbrt", path}});
  const absl::StatusOr<ReadSceneResult> read = ReadScene("room.pbrt", files);
  EXPECT_TRUE(read.ok()) << read.status();
  return read.ok() ? WhyBlack(read->scene) : "";
}

constexpr char kVolumeEmission[] =
    "MakeNamedMedium \"fire\" \"string type\" \"homogeneous\" \"rgb Le\" [1 1 1]\n"
    "MediumInterface \"fire\" \"\"\nMaterial \"interface\"\nShape \"sphere\"\n";

TEST(BlackImageTest, AdvisesByTheFormat) {
  SceneDescription scene;
  scene.files = {"room.glb"};
  EXPECT_EQ(WhyBlack(scene, SceneFormat::kGltf),
            "room.glb: no mesh is shown, so the image will be black; name an image of what "
            "surrounds the scene by --environment, or leave out --environment none");
  scene.world_shapes = {0};
  scene.shapes.resize(1);
  EXPECT_THAT(WhyBlack(scene, SceneFormat::kGltf),
              AllOf(HasSubstr("nothing in the file emits light"), HasSubstr("--environment")));
}

TEST(BlackImageTest, ReportsWhatIsMissing) {
  EXPECT_THAT(WhyBlackOf(""), AllOf(StartsWith("room.pbrt: the scene is empty, "),
                                    HasSubstr("add after WorldBegin a Shape and a light")));
  EXPECT_THAT(WhyBlackOf("Shape \"sphere\"\n"),
              AllOf(StartsWith("room.pbrt: nothing in the scene emits light, "),
                    HasSubstr("LightSource \"infinite\"")));
  EXPECT_THAT(WhyBlackOf("LightSource \"point\"\n"),
              StartsWith("room.pbrt: the scene has no shapes, "));
}

// A light of an object that is defined and placed does not emit.
TEST(BlackImageTest, LightsOfObjectsDoNotCount) {
  EXPECT_THAT(WhyBlackOf("ObjectBegin \"lamp\"\nAreaLightSource \"diffuse\"\nShape \"sphere\"\n"
                         "ObjectEnd\nObjectInstance \"lamp\"\n"),
              HasSubstr("nothing in the scene emits light"));
}

TEST(BlackImageTest, EmptyWhereLightMayArrive) {
  EXPECT_EQ(WhyBlackOf("LightSource \"infinite\"\n"), "");
  EXPECT_EQ(WhyBlackOf("LightSource \"point\"\nShape \"sphere\"\n"), "");
  EXPECT_EQ(WhyBlackOf("AreaLightSource \"diffuse\"\nShape \"sphere\"\n"), "");
  EXPECT_EQ(WhyBlackOf(kVolumeEmission), "");
}

}  // namespace
}  // namespace sheaf
