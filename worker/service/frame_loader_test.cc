// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A scene's files are altered on disk while it is read or rendered. No error that comes of it is
// the scene's: the job continues with whole files. Guiding fields are fetched once a scene.
#include "worker/service/frame_loader.h"

#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <utility>

#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/content/blob_store.h"
#include "common/rpc/manifest_codec.h"

namespace sheaf::worker {
namespace {

// A scene whose tasks all fail, after `before`, unless it has a guiding field.
class FailingScene : public OpenScene {
 public:
  explicit FailingScene(std::function<void()> before) : before_(std::move(before)) {}
  uint64_t memory_bytes() const override { return 0; }
  absl::Status SetField(std::string_view field, std::stop_token /*stop*/) const override {
    field_ = field;
    return field == "no field" ? absl::DataLossError("no field") : absl::OkStatus();
  }
  absl::StatusOr<RenderedPart> Render(const Lease& /*lease*/,
                                      std::stop_token /*stop*/) const override {
    before_();
    if (!field_.empty()) return RenderedPart{"with " + field_};
    return absl::InternalError("it cannot be decoded");
  }

 private:
  const std::function<void()> before_;
  mutable std::string field_;
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

// A coordinator that has one guiding field.
class FakeWorkerService : public v1::WorkerService::Service {
 public:
  grpc::Status ReadGuidingField(grpc::ServerContext* /*context*/,
                                const v1::ReadGuidingFieldRequest* request,
                                grpc::ServerWriter<v1::ReadGuidingFieldResponse>* writer) override {
    ++calls;
    EXPECT_EQ(request->frame_name(), "jobs/1/frames/2");
    if (failures-- > 0) return {grpc::StatusCode::UNAVAILABLE, "starting"};
    if (field.empty()) return {grpc::StatusCode::NOT_FOUND, "no such field"};
    for (const char byte : field) {
      v1::ReadGuidingFieldResponse response;
      response.set_chunk(std::string(1, byte));
      writer->Write(response);
    }
    return grpc::Status::OK;
  }
  std::string field = "a field";
  int calls = 0, failures = 0;
};

// All files are in the cache, so that the coordinator is asked for guiding fields alone.
class FrameLoaderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    grpc::ServerBuilder builder;
    builder.RegisterService(&coordinator_);
    server_ = builder.BuildAndStart();
    folder_ = ::testing::TempDir() + "/frame_loader_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
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
  // A lease that needs a guiding field of these bytes.
  Lease Guided(const std::string& field) const {
    Lease lease = lease_;
    lease.frame_name = "jobs/1/frames/2";
    lease.field = {Sha256Hex(field), field.size()};
    return lease;
  }

  LoadResult Load() {
    loader_ = std::make_unique<FrameLoader>(server_->InProcessChannel({}), cache_.get(), &scenes_,
                                            SceneLimits());
    return loader_->Load(lease_, {});
  }
  // Changes a byte of the scene's file.
  void Alter() const {
    std::filesystem::permissions(file_, std::filesystem::perms::owner_write,
                                 std::filesystem::perm_options::add);
    std::fstream(file_, std::ios::in | std::ios::out | std::ios::binary) << "A";
  }

  FakeWorkerService coordinator_;
  std::unique_ptr<grpc::Server> server_;
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

TEST_F(FrameLoaderTest, FieldsAreFetchedOnceAScene) {
  scenes_.renders = true;
  coordinator_.failures = 1;
  const LoadResult result = Load();
  ASSERT_NE(result.scene, nullptr) << result.status;
  const Lease lease = Guided("a field");
  for (int twice = 0; twice < 2; ++twice) {
    const absl::StatusOr<FinishedPart> part = result.scene->Render(lease, {});
    ASSERT_TRUE(part.ok()) << part.status();
    EXPECT_EQ(part->exr_bytes, "with a field");
    EXPECT_EQ(part->field, lease.field);
  }
  EXPECT_EQ(coordinator_.calls, 2) << "the first call failed, and was repeated";
  // A training needs no field, and the scene no second one.
  EXPECT_TRUE(result.scene->Render(lease_, {}).ok());
  EXPECT_TRUE(absl::IsAborted(result.scene->Render(Guided("another"), {}).status()));
  EXPECT_EQ(coordinator_.calls, 2);
}

TEST_F(FrameLoaderTest, FieldsOfOtherBytesAreNotUsed) {
  scenes_.renders = true;
  const LoadResult result = Load();
  for (const std::string wanted : {"a Field", "a fiel", "a field!"}) {
    const absl::Status status = result.scene->Render(Guided(wanted), {}).status();
    EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  }
  EXPECT_EQ(result.scene->Render(lease_, {}).status().code(), absl::StatusCode::kInternal)
      << "it has no field";
}

TEST_F(FrameLoaderTest, LeasesOfLostFieldsAreGivenBack) {
  scenes_.renders = true;
  coordinator_.field = "";
  const LoadResult result = Load();
  EXPECT_TRUE(absl::IsAborted(result.scene->Render(Guided("a field"), {}).status()));
  std::stop_source stop;
  stop.request_stop();
  const absl::Status stopped = result.scene->Render(Guided("a field"), stop.get_token()).status();
  EXPECT_TRUE(absl::IsCancelled(stopped)) << stopped;
}

TEST_F(FrameLoaderTest, FieldsThatTheSceneRefusesAreReported) {
  scenes_.renders = true;
  coordinator_.field = "no field";
  const LoadResult result = Load();
  EXPECT_TRUE(absl::IsDataLoss(result.scene->Render(Guided("no field"), {}).status()));
}

}  // namespace
}  // namespace sheaf::worker
