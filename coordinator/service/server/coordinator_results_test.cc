// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Results as they come in over the wire: however a frame is cut, whoever renders it, whatever
// breaks on the way, the delivered image has the same bits.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/digest.h"
#include "common/film/exr/exr_codec.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

using Response = v1::UploadResultsResponse;
using ::testing::HasSubstr;

TEST_F(CoordinatorServerTest, EveryPartitionGivesTheSameImage) {
  Start();
  // A few pixels beyond two edges of the smallest tile and one of the middle one, and a few samples
  // beyond the middle pass: every partition cuts this frame in its own way.
  v1::CreateJobRequest request = Request(/*samples=*/19);
  v1::FrameSettings* frame = request.mutable_frames(0)->mutable_settings();
  frame->mutable_window()->set_x0_px(11);
  frame->mutable_window()->set_x1_px(35);
  frame->mutable_window()->set_y0_px(13);
  frame->mutable_window()->set_y1_px(18);
  const std::string expected = DigestOf(*frame);
  int number = 0;
  for (const int32_t tile : {16, 32, 64}) {
    for (const uint64_t pass : {4, 16, 64}) {
      for (const uint64_t lease : {1, 8}) {
        request.set_request_id(absl::StrCat("request-", ++number));
        request.mutable_partition()->set_tile_size_px(tile);
        request.mutable_partition()->set_pass_sample_count(pass);
        request.mutable_partition()->set_lease_pass_count(lease);
        const v1::Job job = Create(request);
        const absl::StatusOr<int> accepted = MakeWorker("w").RenderAll();
        ASSERT_TRUE(accepted.ok()) << accepted.status();
        const v1::Job after = Watch(job.name());
        ASSERT_EQ(after.state(), v1::Job::STATE_SUCCEEDED) << after.DebugString();
        EXPECT_EQ(after.frames(0).image_digest(), expected)
            << "tile " << tile << ", pass " << pass << ", lease " << lease;
        EXPECT_EQ(after.progress().sample_count_done(), 24u * 5u * 19u);
      }
    }
  }
}

TEST_F(CoordinatorServerTest, MergingFromDiskGivesTheSameImage) {
  options_.farm.merge_bytes_max = 0;
  Start();
  v1::CreateJobRequest request = Request(100);
  request.mutable_partition()->set_tile_size_px(16);
  request.mutable_partition()->set_pass_sample_count(4);
  const v1::Job job = Create(request);
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  EXPECT_EQ(Watch(job.name()).frames(0).image_digest(), ExpectedDigest(100));
}

TEST_F(CoordinatorServerTest, ConcurrentWorkersGiveTheSameImage) {
  Start();
  v1::CreateJobRequest request = Request(100);
  request.mutable_partition()->set_tile_size_px(16);
  request.mutable_partition()->set_pass_sample_count(4);
  const v1::Job job = Create(request);
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      SyntheticWorker worker = MakeWorker(absl::StrCat("w", i));
      EXPECT_TRUE(worker.RenderAll().ok());
    });
  }
  for (std::thread& thread : threads) thread.join();
  const v1::Job after = Watch(job.name());
  EXPECT_EQ(after.state(), v1::Job::STATE_SUCCEEDED) << after.DebugString();
  EXPECT_EQ(after.frames(0).image_digest(), ExpectedDigest(100));
}

TEST_F(CoordinatorServerTest, DeliveredFilesHoldImageAndProvenance) {
  Start();
  v1::CreateJobRequest biased = Request(20);
  biased.mutable_frames(0)->mutable_settings()->set_similarity_after_count(8);
  biased.mutable_frames(0)->mutable_settings()->set_max_component_value(12.5f);
  biased.mutable_frames(0)->mutable_settings()->set_sensor("nikon_d850");
  const v1::Job job = Create(biased);
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  const v1::Job after = Watch(job.name());
  ASSERT_EQ(after.state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_NE(after.frames(0).frame_digest(),
            Create(Request(20, "another")).frames(0).frame_digest());
  grpc::ClientContext context;
  v1::ReadFrameOutputRequest request;
  request.set_name(after.frames(0).name());
  const auto reader = jobs_->ReadFrameOutput(&context, request);
  const std::string copy = directory_ + "/copy.exr";
  std::ofstream file(copy, std::ios::binary);
  v1::ReadFrameOutputResponse chunk;
  while (reader->Read(&chunk)) file << chunk.chunk();
  file.close();
  ASSERT_TRUE(reader->Finish().ok());
  const absl::StatusOr<FrameImage> image = ReadFrameImage(copy);
  ASSERT_TRUE(image.ok()) << image.status();
  const FrameImage expected = ImageOf(Settings(20));
  ASSERT_NE(image->Find("R"), nullptr);
  EXPECT_EQ(*image->Find("R"), *expected.Find("R"));
  EXPECT_EQ(image->metadata.at("frameDigest"), after.frames(0).frame_digest());
  EXPECT_EQ(image->metadata.at("numericProfile"), after.numeric_profile());
  EXPECT_EQ(image->metadata.at("similarityAfter"), "8");
  EXPECT_EQ(image->metadata.at("bias"), "similarity, clamped samples");
  EXPECT_EQ(image->metadata.at("maxComponentValue"), "12.5");
  EXPECT_EQ(image->metadata.at("sensor"), "nikon_d850");
}

TEST_F(CoordinatorServerTest, RestartKeepsAcknowledgedResults) {
  Start();
  v1::CreateJobRequest request = Request(100);
  request.mutable_partition()->set_tile_size_px(16);
  request.mutable_partition()->set_pass_sample_count(4);
  const std::string name = Create(request).name();
  double acknowledged = 0;
  uint64_t last_lease_id = 0;
  for (int life = 0; life < 4; ++life) {
    SyntheticWorker worker = MakeWorker(absl::StrCat("w", life));
    for (int i = 0; i < 5; ++i) {
      ASSERT_TRUE(worker.Synchronize(2).ok());
      EXPECT_GT(worker.leases()[0].lease_id(), life == 0 ? 0 : last_lease_id);
      ASSERT_EQ(*worker.RenderOne(), Response::OUTCOME_ACCEPTED);
      ++acknowledged;
    }
    last_lease_id = worker.leases()[0].lease_id();
    const uint64_t done = Get(name).progress().sample_count_done();
    Start();
    EXPECT_EQ(Get(name).progress().sample_count_done(), done);
    EXPECT_EQ(Counter("sheaf_parts_revoked_total"), 0);
  }
  const absl::StatusOr<int> rest = MakeWorker("last").RenderAll();
  ASSERT_TRUE(rest.ok());
  const v1::Job after = Watch(name);
  EXPECT_EQ(after.frames(0).image_digest(), ExpectedDigest(100));
  EXPECT_EQ(Counter("sheaf_duplicate_equal_total") + Counter("sheaf_superseded_total"), 0);
}

TEST_F(CoordinatorServerTest, DamagedPartsAreRenderedAgain) {
  options_.farm.merge_bytes_max = 0;
  Start();
  v1::CreateJobRequest request = Request(100);
  request.mutable_partition()->set_pass_sample_count(4);
  const std::string name = Create(request).name();
  SyntheticWorker worker = MakeWorker("w");
  for (int i = 0; i < 6; ++i) {
    ASSERT_TRUE(worker.Synchronize(1).ok());
    ASSERT_EQ(*worker.RenderOne(), Response::OUTCOME_ACCEPTED);
  }
  // One part loses its file, another one has a bit flipped.
  std::vector<std::string> parts;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(directory_ + "/parts")) {
    if (entry.is_regular_file()) parts.push_back(entry.path());
  }
  ASSERT_EQ(parts.size(), 6u);
  server_.reset();
  std::filesystem::remove(parts[0]);
  {
    std::fstream file(parts[1], std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(-1, std::ios::end);
    const char last = static_cast<char>(file.get());
    file.seekp(-1, std::ios::end);
    file.put(static_cast<char>(last ^ 1));
  }
  Start();
  EXPECT_EQ(Counter("sheaf_parts_revoked_total"), 1);
  SyntheticWorker second = MakeWorker("w2");
  for (int i = 0; i < 200 && Get(name).state() == v1::Job::STATE_RUNNING; ++i) {
    ASSERT_TRUE(second.RenderAll().ok());
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_EQ(Counter("sheaf_parts_revoked_total"), 2);
  EXPECT_EQ(Watch(name).frames(0).image_digest(), ExpectedDigest(100));
}

TEST_F(CoordinatorServerTest, UnstoredResultsAreNotAcknowledged) {
  Start();
  const std::string name = Create(Request(16)).name();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const SyntheticWorker::Upload upload = worker.MakeUpload(worker.leases()[0]);
  // A file where a directory should be refuses writes, also those of root.
  const std::string parts = directory_ + "/parts";
  std::filesystem::remove_all(parts);
  std::ofstream(parts) << "in the way";
  EXPECT_FALSE(worker.Send(upload).ok());
  EXPECT_FALSE(server_->farm().disk().Last().ok());
  EXPECT_EQ(Get(name).progress().sample_count_done(), 0u);
  std::filesystem::remove(parts);
  EXPECT_EQ(*worker.Send(upload), Response::OUTCOME_ACCEPTED);
  EXPECT_TRUE(server_->farm().disk().Last().ok());
}

// A stranger with invented parts, for work that was not leased to it.
TEST_F(CoordinatorServerTest, ResultsWithoutALeaseAreRefused) {
  Start();
  const std::string name = Create(Request(64)).name();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const v1::Lease lease = worker.leases()[0];
  SyntheticWorker stranger = MakeWorker("stranger");
  const auto code_of = [](const SyntheticWorker& sender, const v1::Lease& of) {
    return sender.Send(sender.MakeUpload(of)).status().code();
  };
  v1::Lease made_up = lease;
  made_up.set_lease_id(0);
  made_up.clear_token();
  EXPECT_EQ(code_of(stranger, made_up), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(code_of(stranger, lease), absl::StatusCode::kPermissionDenied) << "another's lease";
  v1::Lease of_more = lease;
  of_more.mutable_key()->mutable_block()->set_first(16);
  EXPECT_EQ(code_of(worker, of_more), absl::StatusCode::kPermissionDenied) << "other work";
  EXPECT_EQ(Counter("sheaf_results_refused_total"), 3);
  EXPECT_EQ(Get(name).progress().sample_count_done(), 0u);
  ASSERT_TRUE(worker.RenderAll().ok());
  EXPECT_EQ(Watch(name).frames(0).image_digest(), ExpectedDigest(64));
}

// The coordinator remembers no lease, but knows its own again.
TEST_F(CoordinatorServerTest, LateResultsAreWelcomeAfterARestart) {
  Start();
  const std::string name = Create(Request(64)).name();
  const SyntheticWorker::Upload late = [&] {
    SyntheticWorker worker = MakeWorker("w");
    EXPECT_TRUE(worker.Synchronize(1).ok());
    return worker.MakeUpload(worker.leases()[0]);
  }();
  Start();
  EXPECT_EQ(*MakeWorker("w").Send(late), Response::OUTCOME_ACCEPTED);
  EXPECT_GT(Get(name).progress().sample_count_done(), 0u);
}

TEST_F(CoordinatorServerTest, FailuresWithoutTheirTokenHaveNoEffect) {
  Start();
  const std::string name = Create(Request(64)).name();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const uint64_t lease_id = worker.leases()[0].lease_id();
  SyntheticWorker forger = MakeWorker("w");  // It has not seen the answer.
  forger.ReportFailure(lease_id, v1::LeaseFailure::KIND_SCENE, "a lie");
  ASSERT_TRUE(forger.Synchronize(0).ok());
  EXPECT_EQ(Get(name).state(), v1::Job::STATE_RUNNING);
  EXPECT_EQ(Counter("sheaf_failures_refused_total"), 1);
  worker.ReportFailure(lease_id, v1::LeaseFailure::KIND_SCENE, "true");
  ASSERT_TRUE(worker.Synchronize(0).ok());
  EXPECT_THAT(Watch(name).failure(), HasSubstr("worker w says: true"));
}

TEST_F(CoordinatorServerTest, QuarantinesSurviveRestarts) {
  Start();
  Create(Request(64));
  SyntheticWorker worker = MakeWorker("w"), other = MakeWorker("other");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const SyntheticWorker::Upload result = worker.MakeUpload(worker.leases()[0]);
  ASSERT_TRUE(other.Synchronize(0).ok());
  {
    FarmTables& tables = server_->farm().tables();
    const MutexLock lock(&tables.mutex);
    tables.scheduler.Quarantine("w", "it lies");
    tables.NoteEndedJobs();
  }
  ASSERT_EQ(worker.Synchronize(1).code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(worker.Send(result).status().code(), absl::StatusCode::kPermissionDenied);
  Start();
  SyntheticWorker again = MakeWorker("w");
  EXPECT_EQ(again.Synchronize(1).code(), absl::StatusCode::kPermissionDenied);
  ASSERT_TRUE(server_->farm().LiftQuarantine("w").ok());
  EXPECT_TRUE(again.Synchronize(1).ok());
  Start();
  EXPECT_TRUE(MakeWorker("w").Synchronize(1).ok());
}

TEST_F(CoordinatorServerTest, UnequalDuplicatesAreDecidedByAThird) {
  Start();
  Create(Request(4));  // Four tasks.
  SyntheticWorker worker = MakeWorker("good");
  ASSERT_TRUE(worker.Synchronize(4).ok());
  SyntheticWorker bad = MakeWorker("bad");
  ASSERT_TRUE(bad.Synchronize(1).ok());
  ASSERT_EQ(bad.leases().size(), 1u) << "a hedge";
  v1::Lease bent = bad.leases()[0];
  const auto same = std::ranges::find_if(worker.leases(), [&](const v1::Lease& lease) {
    return lease.key().SerializeAsString() == bent.key().SerializeAsString();
  });
  ASSERT_NE(same, worker.leases().end());
  EXPECT_EQ(*worker.Send(worker.MakeUpload(*same)), Response::OUTCOME_ACCEPTED);
  EXPECT_EQ(*worker.Send(worker.MakeUpload(*same)), Response::OUTCOME_DUPLICATE_EQUAL);
  bent.mutable_settings()->set_seed(77);
  EXPECT_EQ(*bad.Send(bad.MakeUpload(bent)), Response::OUTCOME_DUPLICATE_MISMATCH);
  EXPECT_EQ(Counter("sheaf_duplicate_mismatch_total"), 1);
  EXPECT_TRUE(bad.Synchronize(0).ok()) << "either may be wrong";
  SyntheticWorker third = MakeWorker("third");
  ASSERT_TRUE(third.Synchronize(1).ok());
  EXPECT_EQ(*third.RenderOne(), Response::OUTCOME_DUPLICATE_EQUAL);
  const absl::Status refused = bad.Synchronize(1);
  EXPECT_EQ(refused.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("differs"));
  EXPECT_TRUE(worker.Synchronize(1).ok());
}

TEST_F(CoordinatorServerTest, ResultsNotMatchingTheirKeyAreRefused) {
  Start();
  Create(Request(64));
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const SyntheticWorker::Upload good = worker.MakeUpload(worker.leases()[0]);
  const auto code_of = [&](const SyntheticWorker::Upload& upload) {
    return worker.Send(upload).status().code();
  };
  SyntheticWorker::Upload bent = good;
  bent.bytes[bent.bytes.size() / 2] ^= 1;
  EXPECT_EQ(code_of(bent), absl::StatusCode::kInvalidArgument);
  bent = good;
  bent.header.mutable_key()->mutable_tile()->set_x1_px(1000);
  EXPECT_EQ(code_of(bent), absl::StatusCode::kPermissionDenied) << "a tile that was not leased";
  bent = good;
  bent.header.mutable_key()->mutable_block()->set_count(3);
  EXPECT_EQ(code_of(bent), absl::StatusCode::kInvalidArgument);
  bent = good;
  bent.bytes += "tail";
  EXPECT_EQ(code_of(bent), absl::StatusCode::kInvalidArgument);
  v1::Lease of_cells = worker.leases()[0];
  of_cells.mutable_key()->set_cell_size_px(8);
  of_cells.mutable_key()->set_cells(1);
  bent = worker.MakeUpload(of_cells);
  *bent.header.mutable_key() = good.header.key();
  EXPECT_EQ(code_of(bent), absl::StatusCode::kInvalidArgument) << "a part of other cells";
  bent = good;
  bent.header.mutable_key()->set_frame_digest(std::string(64, 'a'));
  EXPECT_EQ(code_of(bent), absl::StatusCode::kPermissionDenied) << "a frame that was not leased";
  EXPECT_EQ(Counter("sheaf_results_accepted_total"), 0);
  EXPECT_EQ(*worker.Send(good), Response::OUTCOME_ACCEPTED);
}

TEST_F(CoordinatorServerTest, ImpossibleSumsAreRefusedAndCounted) {
  Start();
  Create(Request(64));
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const SyntheticWorker::Upload good = worker.MakeUpload(worker.leases()[0]);
  absl::StatusOr<DecodedPart> part = DecodePart(good.bytes);
  ASSERT_TRUE(part.ok()) << part.status();
  part->tile.channel(FilmChannel::kRedHi)[0] = -1e30F;
  SyntheticWorker::Upload bent = good;
  bent.bytes = EncodePart(part->tile, part->header);
  bent.header.mutable_digest()->set_sha256_hex(Sha256Hex(bent.bytes));
  bent.header.mutable_digest()->set_size_bytes(bent.bytes.size());
  const absl::Status refused = worker.Send(bent).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("negative light"));
  EXPECT_EQ(Counter("sheaf_results_invalid_total"), 1);
  bent = good;
  bent.header.set_ray_count(~uint64_t{0});
  EXPECT_THAT(std::string(worker.Send(bent).status().message()), HasSubstr("ray_count"));
  EXPECT_EQ(*worker.Send(good), Response::OUTCOME_ACCEPTED);
}

}  // namespace
}  // namespace sheaf::coordinator
