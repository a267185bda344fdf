// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/bundle/reproduction.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>

#include "common/film/exr/exr_codec.h"
#include "tests/support/farm/made_up_bundle.h"
#include "tests/support/temporary_path.h"
#include "worker/sandbox/direct_scenes.h"

namespace sheaf::cli {
namespace {

using coordinator::FailureKind;
using worker::OpenResult;
using worker::OpenScene;
using worker::RenderedPart;

// Opens scenes whose rendering ends as it is told.
class ScriptedScenes : public worker::SceneOpener {
 public:
  explicit ScriptedScenes(absl::StatusOr<RenderedPart> end) : end_(std::move(end)) {}
  OpenResult Open(const worker::SceneInputs& inputs, std::stop_token) override {
    EXPECT_TRUE(std::filesystem::exists(inputs.local_paths.at(inputs.main_file)));
    return {std::make_unique<Scene>(end_), absl::OkStatus(), {}};
  }

 private:
  class Scene : public OpenScene {
   public:
    explicit Scene(absl::StatusOr<RenderedPart> end) : end_(std::move(end)) {}
    uint64_t memory_bytes() const override { return 0; }
    absl::Status SetField(std::string_view, std::stop_token) const override {
      return absl::OkStatus();
    }
    absl::StatusOr<RenderedPart> Render(const worker::Lease&, std::stop_token) const override {
      return end_;
    }
    const absl::StatusOr<RenderedPart> end_;
  };
  const absl::StatusOr<RenderedPart> end_;
};

class ReproductionTest : public ::testing::Test {
 protected:
  ~ReproductionTest() override {
    std::filesystem::remove(path_);
    std::filesystem::remove_all(folder_);
  }
  Reproduction Run(const MadeUpBundle& made, worker::SceneOpener* scenes,
                   const worker::SceneLimits& limits = {}) {
    EXPECT_TRUE(made.WriteTo(path_).ok());
    const absl::StatusOr<Bundle> bundle = OpenBytes(*ReadWholeFile(path_));
    EXPECT_TRUE(bundle.ok()) << bundle.status();
    const auto cache = ContentCache::Open(folder_, {});
    EXPECT_TRUE(cache.ok()) << cache.status();
    const absl::StatusOr<Reproduction> result =
        Reproduce(*bundle, cache->get(), scenes, limits, {});
    EXPECT_TRUE(result.ok()) << result.status();
    return *result;
  }
  Reproduction RunScripted(const MadeUpBundle& made, absl::StatusOr<RenderedPart> end) {
    ScriptedScenes scenes(std::move(end));
    return Run(made, &scenes);
  }
  const std::string path_ = testing::TemporaryPath("bundle.tar");
  const std::string folder_ = testing::TemporaryPath("cache");
};

TEST_F(ReproductionTest, AGoodTaskRendersItsPart) {
  worker::DirectScenes scenes;
  const MadeUpBundle made;
  const Reproduction result = Run(made, &scenes);
  ASSERT_EQ(result.ending, Ending::kRendered) << result.message;
  const absl::StatusOr<DecodedPart> part = DecodePart(result.part.exr_bytes);
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_EQ(part->header.frame_digest, made.task.key().frame_digest());
  EXPECT_EQ(result.part_sha256, Sha256Hex(result.part.exr_bytes));
}

TEST_F(ReproductionTest, ErrorsInTheSceneAndLackOfMemoryAreClassed) {
  worker::DirectScenes scenes;
  MadeUpBundle broken("Camera \"fisheye lens\"\n");
  broken.AddFailure("scene", "other words");
  const Reproduction of_scene = Run(broken, &scenes);
  EXPECT_EQ(of_scene.ending, Ending::kFailedAsRecorded);
  EXPECT_EQ(of_scene.kind, FailureKind::kScene);
  EXPECT_FALSE(of_scene.same_message);
  MadeUpBundle large;
  large.AddFailure("internal", "it broke");
  const Reproduction of_memory = Run(large, &scenes, {.scene_memory_bytes_max = 1});
  EXPECT_EQ(of_memory.ending, Ending::kFailedOtherwise);
  EXPECT_EQ(of_memory.kind, FailureKind::kMemory);
}

TEST_F(ReproductionTest, CrashesAndInvalidResultsAreClassed) {
  MadeUpBundle made;
  made.AddFailure("internal", "rendering: it did not finish within 1s");
  Reproduction result =
      RunScripted(made, absl::InternalError("rendering: it did not finish within 2s"));
  EXPECT_EQ(result.ending, Ending::kFailedAsRecorded);
  EXPECT_TRUE(result.same_message);
  result = RunScripted(made, RenderedPart{"no part", 0, 0});
  EXPECT_EQ(result.ending, Ending::kFailedOtherwise);
  EXPECT_EQ(result.kind, FailureKind::kInvalid);
  made.AddFailure("invalid", result.message);
  EXPECT_EQ(RunScripted(made, RenderedPart{"no part", 0, 0}).ending, Ending::kFailedAsRecorded);
}

TEST(SameMessageTest, NumbersAndCutsMakeNoDifference) {
  EXPECT_TRUE(IsSameMessage("needs 12.5 MiB of 3", "needs 7 MiB of 12"));
  EXPECT_FALSE(IsSameMessage("needs 12 MiB", "needs 12 GiB"));
  EXPECT_TRUE(IsSameMessage("a long te...", "a long text"));
  EXPECT_TRUE(IsSameMessage("at 12...", "at 123, here"));
  EXPECT_FALSE(IsSameMessage("at 12", "at 12, here"));
}

}  // namespace
}  // namespace sheaf::cli
