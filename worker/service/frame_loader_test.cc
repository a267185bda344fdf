// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A scene's files are altered on disk while it is read or rendered. No error that comes of it is
// the scene's: the job continues with whole files. Guiding fields are fetched once a scene, and
// files on demand when a task reads them.
#include "worker/service/frame_loader.h"

#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/content/blob_store.h"
#include "common/content/chunk_codec.h"
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

// A scene that reads the files that a worker fetches for it.
class AskingScene : public OpenScene {
 public:
  explicit AskingScene(OpenOnDemand open) : open_(std::move(open)) {}
  uint64_t memory_bytes() const override { return 0; }
  absl::Status SetField(std::string_view /*field*/, std::stop_token /*stop*/) const override {
    return absl::OkStatus();
  }
  // The lease's name is the file's. A file that does not come is a defect to the process.
  absl::StatusOr<RenderedPart> Render(const Lease& lease, std::stop_token stop) const override {
    const auto file = open_(lease.frame_name, stop);
    if (!file.ok()) return absl::InternalError(file.status().message());
    RenderedPart part{std::string(file->size(), ' ')};
    if (!file->Read(0, file->size(), part.exr_bytes.data())) return absl::InternalError("no bytes");
    return part;
  }

 private:
  const OpenOnDemand open_;
};

class AskingScenes : public SceneOpener {
 public:
  OpenResult Open(const SceneInputs& inputs, std::stop_token /*stop*/) override {
    local_paths = inputs.local_paths;
    on_demand_bytes = inputs.on_demand_bytes;
    return {std::make_unique<AskingScene>(inputs.open_on_demand), absl::OkStatus()};
  }
  std::map<std::string, std::string> local_paths;
  uint64_t on_demand_bytes = 0;
};

// A coordinator that has blobs, and sends them with a wrong byte for some time.
class FakeContentService : public v1::ContentService::Service {
 public:
  grpc::Status ReadBlob(grpc::ServerContext* /*context*/, const v1::ReadBlobRequest* request,
                        grpc::ServerWriter<v1::ReadBlobResponse>* writer) override {
    ++calls;
    if (failures-- > 0) return {grpc::StatusCode::UNAVAILABLE, "starting"};
    const auto found = blobs.find(request->digest().sha256_hex());
    if (found == blobs.end()) return {grpc::StatusCode::NOT_FOUND, "no such blob"};
    std::string bytes = found->second.substr(request->offset_bytes());
    if (wrong-- > 0) bytes[0] = static_cast<char>(~bytes[0]);
    v1::ReadBlobResponse response;
    response.set_zstd_chunk(CompressChunk(bytes));
    writer->Write(response);
    return grpc::Status::OK;
  }
  BlobDigest Add(const std::string& bytes) {
    blobs[Sha256Hex(bytes)] = bytes;
    return {Sha256Hex(bytes), bytes.size()};
  }
  std::map<std::string, std::string> blobs;
  int calls = 0, failures = 0, wrong = 0;
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

// A scene of one file that comes with it, and two that are fetched when they are read.
class OnDemandTest : public FrameLoaderTest {
 protected:
  void SetUp() override {
    FrameLoaderTest::SetUp();
    grpc::ServerBuilder builder;
    builder.RegisterService(&content_);
    content_server_ = builder.BuildAndStart();
    lease_.scene = content_.Add(EncodeManifest(
        MakeManifest("scene.pbrt", {{"scene.pbrt", content_.Add("a scene")},
                                    {"cloud.vdb.parts/0000", content_.Add("near"), true},
                                    {"cloud.vdb.parts/0001", content_.Add("far off"), true}})));
    loader_ = std::make_unique<FrameLoader>(content_server_->InProcessChannel({}), cache_.get(),
                                            &asking_, SceneLimits());
    loaded_ = loader_->Load(lease_, {});
    ASSERT_NE(loaded_.scene, nullptr) << loaded_.status;
  }
  absl::StatusOr<FinishedPart> Read(const std::string& name) {
    Lease lease = lease_;
    lease.frame_name = name;
    return loaded_.scene->Render(lease, {});
  }

  FakeContentService content_;
  std::unique_ptr<grpc::Server> content_server_;
  AskingScenes asking_;
  LoadResult loaded_;
};

TEST_F(OnDemandTest, FilesAreFetchedWhenTheyAreRead) {
  EXPECT_EQ(content_.calls, 1);  // The manifest; the scene is in the cache.
  EXPECT_EQ(asking_.local_paths.size(), 1u);
  EXPECT_EQ(asking_.on_demand_bytes, 4u + 7u);
  EXPECT_EQ(Read("cloud.vdb.parts/0001")->exr_bytes, "far off");
  EXPECT_EQ(content_.calls, 2);
  EXPECT_EQ(Read("cloud.vdb.parts/0001")->exr_bytes, "far off");
  EXPECT_EQ(content_.calls, 2);
}

TEST_F(OnDemandTest, NoOtherFileIsOpened) {
  for (const char* name : {"scene.pbrt", "../../etc/passwd", "/etc/passwd", ""}) {
    EXPECT_TRUE(absl::IsInternal(Read(name).status())) << name;
  }
}

TEST_F(OnDemandTest, ACoordinatorThatIsAwayIsAskedAgain) {
  content_.failures = 2;
  EXPECT_EQ(Read("cloud.vdb.parts/0000")->exr_bytes, "near");
  EXPECT_EQ(content_.calls, 4);
}

TEST_F(OnDemandTest, WrongBytesAreRefusedAndFetchedAgain) {
  content_.wrong = 1;
  EXPECT_EQ(Read("cloud.vdb.parts/0000")->exr_bytes, "near");
  EXPECT_EQ(content_.calls, 3);
}

TEST_F(OnDemandTest, AFileThatDoesNotComeIsNotTheScenesFault) {
  content_.wrong = 100;
  EXPECT_TRUE(absl::IsDataLoss(Read("cloud.vdb.parts/0000").status()));
  EXPECT_EQ(content_.calls, 1 + kWrongBytesMax);
  content_.wrong = 0;
  // Its zeros may be in any image: the scene must be loaded again.
  EXPECT_TRUE(absl::IsDataLoss(Read("cloud.vdb.parts/0001").status()));
  loaded_ = loader_->Load(lease_, {});
  EXPECT_EQ(Read("cloud.vdb.parts/0000")->exr_bytes, "near");
}

TEST_F(OnDemandTest, FilesAlteredAfterwardsAreNotTheScenesFault) {
  ASSERT_TRUE(Read("cloud.vdb.parts/0000").ok());
  const std::string hex = Sha256Hex("near");
  file_ = folder_ + "/blobs/" + hex.substr(0, 2) + "/" + hex;
  Alter();
  EXPECT_TRUE(absl::IsDataLoss(Read("cloud.vdb.parts/0001").status()));
}

}  // namespace
}  // namespace sheaf::worker
