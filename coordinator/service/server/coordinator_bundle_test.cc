// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ReadTaskBundle: which task it sends, and with what.
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "common/base/digest.h"
#include "common/content/chunk_codec.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

struct ReadBundle {
  grpc::Status status;
  v1::TaskBundle task;
  std::vector<std::string> order;            // Digests of the files.
  std::map<std::string, std::string> files;  // By digest.
};

class BundleTest : public CoordinatorServerTest {
 protected:
  ReadBundle Read(const std::string& name, std::optional<int32_t> frame = {},
                  std::optional<uint32_t> task = {}) {
    v1::ReadTaskBundleRequest request;
    request.set_name(name);
    if (frame) request.set_frame_number(*frame);
    if (task) request.set_task(*task);
    grpc::ClientContext context;
    SetDeadline(&context, kPatience);
    const auto reader = jobs_->ReadTaskBundle(&context, request);
    ReadBundle read;
    v1::ReadTaskBundleResponse response;
    while (reader->Read(&response)) {
      if (response.has_bundle()) {
        read.task = response.bundle();
        continue;
      }
      if (response.has_file()) read.order.push_back(response.file().sha256_hex());
      read.files[read.order.back()] += *DecompressChunk(response.zstd_chunk(), kBlobChunkBytesMax);
    }
    read.status = reader->Finish();
    for (const auto& [digest, bytes] : read.files) EXPECT_EQ(Sha256Hex(bytes), digest);
    return read;
  }
  // Has a worker fail the task that is leased to it first.
  void Fail(const std::string& id, v1::LeaseFailure::Kind kind, const std::string& words) {
    SyntheticWorker worker = MakeWorker(id);
    ASSERT_TRUE(worker.Synchronize(1).ok());
    ASSERT_EQ(worker.leases().size(), 1u);
    worker.ReportFailure(worker.leases()[0].lease_id(), kind, words);
    ASSERT_TRUE(worker.Synchronize(0).ok());
  }
};

TEST_F(BundleTest, ATaskThatIsSetAsideComesFirstWithItsFailuresAndFiles) {
  options_.farm.limits.poison_workers_max = 2;
  Start();
  const std::string name = Create(Request(64)).name();
  Fail("a", v1::LeaseFailure::KIND_INTERNAL, "it broke");
  Fail("b", v1::LeaseFailure::KIND_MEMORY, "it is large");
  const ReadBundle read = Read(name);
  ASSERT_TRUE(read.status.ok()) << read.status.error_message();
  EXPECT_EQ(read.task.frame_name(), name + "/frames/1");
  EXPECT_FALSE(read.task.whole_frame());
  EXPECT_EQ(read.task.key().frame_digest(), Get(name).frames(0).frame_digest());
  ASSERT_EQ(read.task.failures_size(), 2);
  EXPECT_EQ(read.task.failures(0).kind(), "internal");
  EXPECT_EQ(read.task.failures(0).worker(), "a");
  EXPECT_EQ(read.task.failures(0).message(), "it broke");
  EXPECT_EQ(read.task.failures(1).message(), "it is large");
  EXPECT_THAT(read.task.set_aside(), HasSubstr("a by a crash, b by lack of memory"));
  ASSERT_EQ(read.order.size(), 2u);
  EXPECT_EQ(read.order[0], read.task.scene().sha256_hex());
  EXPECT_EQ(read.files.at(read.order[1]), "a scene");
}

TEST_F(BundleTest, ASceneErrorIsOneOfTheFrame) {
  Start();
  const std::string name = Create(Request(64)).name();
  Fail("a", v1::LeaseFailure::KIND_SCENE, "scene.pbrt:1: no camera");
  EXPECT_EQ(Get(name).state(), v1::Job::STATE_FAILED);
  const ReadBundle read = Read(name);
  ASSERT_TRUE(read.status.ok()) << read.status.error_message();
  EXPECT_TRUE(read.task.whole_frame());
  ASSERT_EQ(read.task.failures_size(), 1);
  EXPECT_EQ(read.task.failures(0).kind(), "scene");
  EXPECT_EQ(read.task.failures(0).message(), "scene.pbrt:1: no camera");
}

TEST_F(BundleTest, OtherTasksMustBeNamed) {
  Start();
  const std::string name = Create(Request(64)).name();
  const ReadBundle none = Read(name);
  EXPECT_EQ(none.status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_THAT(none.status.error_message(), HasSubstr("no task of it has failed; name one"));
  EXPECT_THAT(Read(name, 1, 9999).status.error_message(), HasSubstr("has no task 9999, only 0 to"));
  EXPECT_THAT(Read(name, 2).status.error_message(), HasSubstr("no frame 2"));
  EXPECT_EQ(Read(name, {}, 1).status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  const ReadBundle good = Read(name, 1, 0);
  ASSERT_TRUE(good.status.ok()) << good.status.error_message();
  EXPECT_EQ(good.task.failures_size(), 0);
  EXPECT_EQ(good.task.key().block().count(), 16u);
}

TEST_F(BundleTest, TasksOfGuidedFramesBringTheirField) {
  Start();
  v1::CreateJobRequest request = Request(64);
  request.mutable_frames(0)->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA_GUIDED);
  const std::string name = Create(request).name();
  EXPECT_THAT(Read(name, 1, 0).status.error_message(), HasSubstr("the guiding field of frame 1"));
  EXPECT_EQ(Read(name, 1).task.key().kind(), v1::TASK_KIND_TRAINING);
  SyntheticWorker worker = MakeWorker("a");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  ASSERT_TRUE(worker.RenderOne().ok());
  const ReadBundle read = Read(name, 1, 0);
  ASSERT_TRUE(read.status.ok()) << read.status.error_message();
  ASSERT_EQ(read.order.size(), 3u);
  EXPECT_EQ(read.order[1], read.task.guiding_field().sha256_hex());
}

TEST_F(BundleTest, AFileThatIsNotKeptIsNamed) {
  Start();
  const std::string name = Create(Request(64)).name();
  const BlobDigest file = *server_->farm().blobs().Put("a scene");
  std::filesystem::remove(server_->farm().blobs().FinalPath(file));
  const ReadBundle read = Read(name, 1, 0);
  EXPECT_EQ(read.status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(read.status.error_message(), HasSubstr("the scene's file scene.pbrt ("));
}

}  // namespace
}  // namespace sheaf::coordinator
