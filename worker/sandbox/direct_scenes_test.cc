// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/direct_scenes.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "common/base/load_phases.h"
#include "common/scene/file_source.h"
#include "common/scene/reader/scene_file_reader.h"

namespace sheaf::worker {
namespace {

constexpr char kManifest[] = "the digest of the manifest";
constexpr char kScene[] =
    "Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8\n"
    "Camera \"perspective\"\nWorldBegin\nLightSource \"infinite\"\n"
    "Translate 0 0 3\nShape \"sphere\"\n";

class DirectScenesTest : public ::testing::Test {
 protected:
  DirectScenesTest() : path_(::testing::TempDir() + "/direct_scenes_test.pbrt") {
    std::ofstream(path_) << kScene;
    inputs_.main_file = "room.pbrt";
    inputs_.local_paths = {{"room.pbrt", path_}};
    inputs_.settings = *ResolveSettings(Read(), RenderSettings());
    inputs_.manifest_sha256_hex = kManifest;
  }
  ~DirectScenesTest() override { std::filesystem::remove(path_); }

  SceneDescription Read() const {
    TableFileSource files(inputs_.local_paths);
    return ReadSceneByName("room.pbrt", files, {})->scene;
  }
  // The part of the whole image.
  std::string RenderedBy(DirectScenes* scenes) const {
    const OpenResult opened = scenes->Open(inputs_, {});
    EXPECT_TRUE(opened.status.ok()) << opened.status;
    if (opened.scene == nullptr) return "";
    Lease lease;
    lease.settings = inputs_.settings;
    lease.tile = inputs_.settings.window;
    lease.block = {0, 16};
    const absl::StatusOr<RenderedPart> part = opened.scene->Render(lease, {});
    EXPECT_TRUE(part.ok()) << part.status();
    return part.ok() ? part->exr_bytes : "";
  }
  static uint64_t ReadCount() { return LoadTimesNow().Of(LoadPhase::kRead).count; }

  const std::string path_;
  SceneInputs inputs_;
};

TEST_F(DirectScenesTest, AnExpectedSceneIsNotReadAgain) {
  DirectScenes scenes;
  const std::string read = RenderedBy(&scenes);
  scenes.Expect(kManifest, Read());
  const uint64_t reads = ReadCount();
  EXPECT_EQ(RenderedBy(&scenes), read) << "the same bits";
  EXPECT_EQ(ReadCount(), reads);
  EXPECT_EQ(RenderedBy(&scenes), read);
  EXPECT_EQ(ReadCount(), reads + 1) << "the description was given to the first Open";
}

TEST_F(DirectScenesTest, OtherScenesAreRead) {
  DirectScenes scenes;
  scenes.Expect("the digest of another manifest", SceneDescription());
  const uint64_t reads = ReadCount();
  EXPECT_FALSE(RenderedBy(&scenes).empty());
  EXPECT_EQ(ReadCount(), reads + 1);
}

TEST_F(DirectScenesTest, TheWatchSeesWhatASceneHolds) {
  render::SceneMemory seen;
  DirectScenes scenes([] { return FindMemoryRoom(); },
                      [&seen](const render::SceneMemory& memory) { seen = memory; });
  RenderedBy(&scenes);
  EXPECT_GT(seen.mesh_bytes, 0u);
  EXPECT_GT(seen.tracer_bytes, 0u);
  EXPECT_EQ(seen.texture_bytes, 0u);
  EXPECT_EQ(seen.environment_bytes, 0u) << "the light has no map";
  EXPECT_EQ(seen.volume_bytes, 0u);
  EXPECT_EQ(seen.guiding_bytes, 0u);
}

}  // namespace
}  // namespace sheaf::worker
