// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Results that come with their worker's state, several in one call (DeliverResults).
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/rpc/grpc_status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

using Response = v1::UploadResultsResponse;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::SizeIs;

class DeliveriesTest : public CoordinatorServerTest {
 protected:
  v1::Job StartJob() {
    Start();
    v1::CreateJobRequest request = Request(100);
    request.mutable_partition()->set_tile_size_px(16);
    request.mutable_partition()->set_pass_sample_count(4);
    request.mutable_partition()->set_lease_pass_count(1);
    return Create(request);
  }
  static std::vector<SyntheticWorker::Upload> UploadsOf(const SyntheticWorker& worker) {
    std::vector<SyntheticWorker::Upload> uploads;
    for (const v1::Lease& lease : worker.leases()) uploads.push_back(worker.MakeUpload(lease));
    return uploads;
  }
  // Until there is no lease any more. Returns how many results were accepted.
  static int RenderAll(SyntheticWorker* worker, int leases) {
    EXPECT_TRUE(worker->Synchronize(leases).ok());
    int accepted = 0;
    while (!worker->leases().empty()) {
      const auto outcomes = worker->Deliver(UploadsOf(*worker), leases);
      EXPECT_TRUE(outcomes.ok()) << outcomes.status();
      if (!outcomes.ok()) return accepted;
      for (const auto outcome : *outcomes) accepted += outcome == Response::OUTCOME_ACCEPTED;
    }
    return accepted;
  }
};

TEST_F(DeliveriesTest, GiveTheSameImage) {
  const v1::Job job = StartJob();
  SyntheticWorker worker = MakeWorker("w");
  EXPECT_GT(RenderAll(&worker, 16), 100);
  const v1::Job after = Watch(job.name());
  ASSERT_EQ(after.state(), v1::Job::STATE_SUCCEEDED) << after.DebugString();
  EXPECT_EQ(after.frames(0).image_digest(), ExpectedDigest(100));
}

TEST_F(DeliveriesTest, OfConcurrentWorkersGiveTheSameImage) {
  const v1::Job job = StartJob();
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      SyntheticWorker worker = MakeWorker(absl::StrCat("w", i));
      RenderAll(&worker, 1 + 3 * i);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(Watch(job.name()).frames(0).image_digest(), ExpectedDigest(100));
}

TEST_F(DeliveriesTest, RepeatedOnesAreDuplicates) {
  StartJob();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(3).ok());
  const std::vector<SyntheticWorker::Upload> uploads = UploadsOf(worker);
  ASSERT_THAT(uploads, SizeIs(3));
  const auto first = worker.Deliver(uploads, 3), second = worker.Deliver(uploads, 3);
  ASSERT_TRUE(first.ok() && second.ok()) << first.status() << second.status();
  EXPECT_THAT(*first, Each(Response::OUTCOME_ACCEPTED));
  EXPECT_THAT(*second, Each(Response::OUTCOME_DUPLICATE_EQUAL));
  EXPECT_THAT(worker.leases(), SizeIs(3)) << "the same leases, none of them twice";
  // One result twice in a call.
  SyntheticWorker other = MakeWorker("other");
  ASSERT_TRUE(other.Synchronize(1).ok());
  const SyntheticWorker::Upload upload = UploadsOf(other).front();
  const auto twice = other.Deliver({upload, upload}, 1);
  ASSERT_TRUE(twice.ok()) << twice.status();
  EXPECT_THAT(*twice, ElementsAre(Response::OUTCOME_ACCEPTED, Response::OUTCOME_DUPLICATE_EQUAL));
}

TEST_F(DeliveriesTest, AFalseResultRefusesTheCallAndNotTheOthers) {
  StartJob();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(3).ok());
  std::vector<SyntheticWorker::Upload> uploads = UploadsOf(worker);
  ASSERT_THAT(uploads, SizeIs(3));
  uploads[1].bytes[100] ^= 1;
  EXPECT_TRUE(absl::IsInvalidArgument(worker.Deliver(uploads, 3).status()));
  uploads.erase(uploads.begin() + 1);
  const auto outcomes = worker.Deliver(uploads, 3);
  ASSERT_TRUE(outcomes.ok()) << outcomes.status();
  EXPECT_THAT(*outcomes, Each(Response::OUTCOME_DUPLICATE_EQUAL)) << "they were durable";
}

TEST_F(DeliveriesTest, HaveLimits) {
  StartJob();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const SyntheticWorker::Upload upload = UploadsOf(worker).front();
  const std::vector<SyntheticWorker::Upload> many(kResultsPerDeliveryMax + 1, upload);
  EXPECT_TRUE(absl::IsInvalidArgument(worker.Deliver(many, 1).status()));
  SyntheticWorker::Upload large = upload;
  large.bytes.resize(kDeliveryBytesMax + 1);
  EXPECT_TRUE(absl::IsInvalidArgument(worker.Deliver({large}, 1).status()));
  SyntheticWorker::Upload stored = upload;
  stored.header.set_stored(true);
  EXPECT_TRUE(absl::IsInvalidArgument(worker.Deliver({stored}, 1).status()));
  EXPECT_TRUE(worker.Deliver({upload}, 1).ok());
}

}  // namespace
}  // namespace sheaf::coordinator
