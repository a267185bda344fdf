// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Frames with light paths: their light passes are tasks beside those of the tiles, and the image is
// one.
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

using Response = v1::UploadResultsResponse;

// A frame of both kinds of path, 41 x 33 pixels of 50 x 40.
v1::CreateJobRequest WithLight(v1::CreateJobRequest request) {
  request.mutable_frames(0)->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA_AND_LIGHT);
  return request;
}

TEST_F(CoordinatorServerTest, LightPassesGiveOneImage) {
  int number = 0;
  for (const uint64_t merge_bytes : {uint64_t{0}, uint64_t{1} << 30}) {
    options_.farm.merge_bytes_max = merge_bytes;
    Start();
    for (const uint64_t lease : {1, 8}) {
      v1::CreateJobRequest request = WithLight(Request(/*samples=*/37));
      request.set_request_id(absl::StrCat("light-", ++number));
      request.mutable_partition()->set_tile_size_px(16);
      request.mutable_partition()->set_pass_sample_count(4);
      request.mutable_partition()->set_lease_pass_count(lease);
      const std::string expected = DigestOf(request.frames(0).settings());
      EXPECT_NE(expected, ExpectedDigest(37));
      const v1::Job job = Create(request);
      std::vector<std::thread> threads;
      for (int i = 0; i < 3; ++i) {
        threads.emplace_back(
            [&, i] { EXPECT_TRUE(MakeWorker(absl::StrCat("w", i)).RenderAll().ok()); });
      }
      for (std::thread& thread : threads) thread.join();
      const v1::Job after = Watch(job.name());
      ASSERT_EQ(after.state(), v1::Job::STATE_SUCCEEDED) << after.DebugString();
      EXPECT_EQ(after.frames(0).image_digest(), expected) << merge_bytes << ", lease " << lease;
      // Light paths are those of the whole frame.
      EXPECT_EQ(after.progress().sample_count_done(), 37u * (41 * 33 + 50 * 40));
      EXPECT_EQ(after.frames(0).tile_count(), 9u);
    }
  }
}

// A window of one tile has the rectangle of the light tile.
TEST_F(CoordinatorServerTest, LightPassesSurviveARestart) {
  Start();
  v1::CreateJobRequest request = WithLight(Request(64));
  request.mutable_partition()->set_tile_size_px(64);
  request.mutable_partition()->set_lease_pass_count(1);
  const std::string expected = DigestOf(request.frames(0).settings());
  const v1::Job job = Create(request);
  SyntheticWorker worker = MakeWorker("w");
  int light_count = 0;
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(worker.Synchronize(1).ok());
    ASSERT_EQ(worker.leases().size(), 1u);
    light_count += worker.leases()[0].key().kind() == v1::TASK_KIND_LIGHT ? 1 : 0;
    ASSERT_EQ(*worker.RenderOne(), Response::OUTCOME_ACCEPTED);
  }
  EXPECT_EQ(light_count, 2);
  Start();
  ASSERT_TRUE(MakeWorker("v").RenderAll().ok());
  EXPECT_EQ(Watch(job.name()).frames(0).image_digest(), expected);
  EXPECT_EQ(Counter("sheaf_results_accepted_total"), 4);
}

TEST_F(CoordinatorServerTest, LightPassesThatAreNoneAreRefused) {
  Start();
  v1::CreateJobRequest request = WithLight(Request(64));
  request.mutable_partition()->set_tile_size_px(64);
  Create(request);
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(2).ok());
  ASSERT_EQ(worker.leases().size(), 2u);
  const v1::Lease camera = worker.leases()[0], light = worker.leases()[1];
  ASSERT_EQ(camera.key().kind(), v1::TASK_KIND_CAMERA);
  ASSERT_EQ(light.key().kind(), v1::TASK_KIND_LIGHT);
  ASSERT_EQ(light.key().tile().DebugString(), camera.key().tile().DebugString());
  // The part of one kind for the task of the other.
  SyntheticWorker::Upload bent = worker.MakeUpload(camera);
  *bent.header.mutable_key()->mutable_block() = light.key().block();
  bent.header.mutable_key()->set_kind(v1::TASK_KIND_LIGHT);
  bent.header.set_lease_id(light.lease_id());
  bent.header.set_token(light.token());
  const absl::Status refused = worker.Send(bent).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
  // The right to one is none to the other.
  bent = worker.MakeUpload(light);
  bent.header.mutable_key()->set_kind(v1::TASK_KIND_CAMERA);
  EXPECT_EQ(worker.Send(bent).status().code(), absl::StatusCode::kPermissionDenied);
  bent.header.mutable_key()->set_kind(static_cast<v1::TaskKind>(7));
  EXPECT_EQ(worker.Send(bent).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace sheaf::coordinator
