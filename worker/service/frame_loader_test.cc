// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A scene's files are altered on disk while it is read or rendered. No error that comes of it is
// the scene's: the job goes on with whole files.
#include "worker/service/frame_loader.h"

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <utility>

#include "common/base/check.h"
#include "common/content/blob_store.h"
#include "common/rpc/manifest_codec.h"

namespace sheaf::worker {
namespace {

// A scene whose tasks all fail, after `before`.
class FailingScene : public OpenScene {
 public:
  explicit FailingScene(std::function<void()> before) : before_(std::move(before)) {}
  uint64_t memory_bytes() const override { return 0; }
  absl::StatusOr<RenderedPart> Render(const Lease& /*lease*/,
                                      std::stop_token /*stop*/) const override {
    before_();
    return absl::InternalError("it cannot be decoded");
  }

 private:
  const std::function<void()> before_;
};

class FakeScenes : public SceneOpener {
 public:
  OpenResult Open(const SceneInputs& /*inputs*/, std::stop_token /*stop*/) override {
    if (renders) return {std::make_unique<FailingScene>(before), absl::OkStatus()};
    before();
    return {nullptr, absl::InvalidArgumentError("it cannot be decoded"), FailureKind::kScene};
  }
  std::function<void()> before = [] {};
  bool renders = false;
};

// All files are in the cache, so the coordinator is not asked.
class FrameLoaderTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "/frame_loader_" +
              testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    auto cache = ContentCache::Open(folder_, {});
    SHEAF_CHECK(cache.ok());
    cache_ = *std::move(cache);
    auto blobs = BlobStore::Open(folder_ + "/blobs");
    SHEAF_CHECK(blobs.ok());
    const auto file = (*blobs)->Put("a scene");
    SHEAF_CHECK(file.ok());
    file_ = folder_ + "/blobs/" + file->sha256_hex.substr(0, 2) + "/" + file->sha256_hex;
    const auto manifest =
        (*blobs)->Put(EncodeManifest(MakeManifest("scene.pbrt", {{"scene.pbrt", *file}})));
    SHEAF_CHECK(manifest.ok());
    lease_.scene = *manifest;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  LoadResult Load() {
    loader_ = std::make_unique<FrameLoader>(
        grpc::CreateChannel("127.0.0.1:1", grpc::InsecureChannelCredentials()), cache_.get(),
        &scenes_, SceneLimits());
    return loader_->Load(lease_, {});
  }
  // Changes a byte of the scene's file.
  void Alter() const {
    std::filesystem::permissions(file_, std::filesystem::perms::owner_write,
                                 std::filesystem::perm_options::add);
    std::fstream(file_, std::ios::in | std::ios::out | std::ios::binary) << "A";
  }

  std::string folder_, file_;
  std::unique_ptr<ContentCache> cache_;
  FakeScenes scenes_;
  std::unique_ptr<FrameLoader> loader_;
  Lease lease_;
};

TEST_F(FrameLoaderTest, ScenesThatCannotBeReadFail) {
  const LoadResult result = Load();
  EXPECT_EQ(result.failure_kind, FailureKind::kScene);
}

TEST_F(FrameLoaderTest, FilesAlteredWhileASceneIsReadAreNotItsFault) {
  scenes_.before = [this] { Alter(); };
  const LoadResult result = Load();
  EXPECT_EQ(result.scene, nullptr);
  EXPECT_EQ(result.failure_kind, FailureKind::kInfrastructure);
  EXPECT_EQ(result.status.code(), absl::StatusCode::kDataLoss) << result.status;
}

TEST_F(FrameLoaderTest, ErrorsOfTasksAreTheScenes) {
  scenes_.renders = true;
  const LoadResult result = Load();
  ASSERT_NE(result.scene, nullptr) << result.status;
  EXPECT_EQ(result.scene->Render(lease_, {}).status().code(), absl::StatusCode::kInternal);
}

TEST_F(FrameLoaderTest, FilesAlteredDuringATaskAreNotTheScenesFault) {
  scenes_.renders = true;
  scenes_.before = [this] { Alter(); };
  const LoadResult result = Load();
  ASSERT_NE(result.scene, nullptr) << result.status;
  EXPECT_EQ(result.scene->Render(lease_, {}).status().code(), absl::StatusCode::kDataLoss);
}

}  // namespace
}  // namespace sheaf::worker
