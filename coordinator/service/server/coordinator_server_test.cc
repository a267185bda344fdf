// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The coordinator's calls as its clients meet them: jobs, content, previews, health, ports.
#include "coordinator/service/server/coordinator_server.h"

#include <grpcpp/generic/generic_stub.h>

#include <algorithm>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/digest.h"
#include "common/content/chunk_codec.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

using Response = v1::UploadResultsResponse;
using ::testing::HasSubstr;

TEST_F(CoordinatorServerTest, JobCreationIsCheckedAndIdempotent) {
  Start();
  const v1::Job first = Create(Request(4));
  EXPECT_EQ(Create(Request(4)).name(), first.name());
  v1::Job job;
  v1::CreateJobRequest request = Request(4, "other");
  request.mutable_frames(0)->mutable_scene()->set_sha256_hex(std::string(64, 'b'));
  grpc::Status status = TryCreate(request, &job);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr(std::string(64, 'b')));
  request = Request(0, "other");
  EXPECT_EQ(TryCreate(request, &job).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  request = Request(4, "other");
  request.mutable_partition()->set_pass_sample_count(12);
  EXPECT_EQ(TryCreate(request, &job).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  request = Request(4, "");
  EXPECT_EQ(TryCreate(request, &job).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(CoordinatorServerTest, ForeignTextIsMadePrintable) {
  Start();
  v1::Job job;
  v1::CreateJobRequest request = Request(4, "other");
  request.set_title("a title\n2026-01-01T00:00:00 sheaf-coordinator error forged");
  const grpc::Status status = TryCreate(request, &job);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("title: has a control character at byte 7"));
  const absl::Status unnamed = MakeWorker("w\x1b[2J").Synchronize(1);
  EXPECT_EQ(unnamed.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(unnamed.message()), HasSubstr("worker_id"));
  const std::string name = Create(Request(4)).name();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  worker.ReportFailure(worker.leases().at(0).lease_id(), v1::LeaseFailure::KIND_INFRASTRUCTURE,
                       "two\nlines");
  ASSERT_TRUE(worker.Synchronize(0).ok());
  const auto failures =
      server_->farm().view().ListFailures(name.substr(std::string("jobs/").size()));
  ASSERT_TRUE(failures.ok()) << failures.status();
  ASSERT_EQ(failures->size(), 1u);
  EXPECT_EQ(failures->at(0).failure.message, "two\\nlines");
}

TEST_F(CoordinatorServerTest, InvalidJobsAreRefused) {
  Start();
  v1::Job job;
  v1::CreateJobRequest request = Request(uint64_t{1} << 40);
  v1::FrameSettings* frame = request.mutable_frames(0)->mutable_settings();
  frame->set_width_px(65536);
  frame->set_height_px(65536);
  frame->mutable_window()->set_x0_px(0);
  frame->mutable_window()->set_y0_px(0);
  frame->mutable_window()->set_x1_px(65536);
  frame->mutable_window()->set_y1_px(65536);
  const grpc::Status status = TryCreate(request, &job);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("4294967296 pixels"));
}

TEST_F(CoordinatorServerTest, CancelledJobsStayCancelled) {
  Start();
  const std::string name = Create(Request(64)).name();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(2).ok());
  ASSERT_EQ(*worker.RenderOne(), Response::OUTCOME_ACCEPTED);
  grpc::ClientContext context;
  v1::CancelJobRequest request;
  request.set_name(name);
  v1::Job job;
  ASSERT_TRUE(jobs_->CancelJob(&context, request, &job).ok());
  EXPECT_EQ(job.state(), v1::Job::STATE_CANCELLED);
  EXPECT_EQ(*worker.RenderOne(), Response::OUTCOME_SUPERSEDED);
  ASSERT_TRUE(worker.Synchronize(2).ok());
  EXPECT_TRUE(worker.leases().empty());
  Start();
  EXPECT_EQ(Get(name).state(), v1::Job::STATE_CANCELLED);
}

TEST_F(CoordinatorServerTest, FailuresNameSceneAndRenderCommand) {
  Start();
  const std::string id = Create(Request(64)).name().substr(std::string("jobs/").size());
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const v1::Lease lease = worker.leases().at(0);
  ASSERT_EQ(server_->farm().view().ListWorkers().at(0).leases.size(), 1u);
  EXPECT_EQ(server_->farm().view().ListWorkers()[0].warm_scenes,
            std::vector<std::string>{"scene.pbrt"});
  worker.ReportFailure(lease.lease_id(), v1::LeaseFailure::KIND_INFRASTRUCTURE, "no disk");
  ASSERT_TRUE(worker.Synchronize(0).ok());
  const auto failures = server_->farm().view().ListFailures(id);
  ASSERT_TRUE(failures.ok());
  ASSERT_EQ(failures->size(), 1u);
  EXPECT_EQ(failures->at(0).failure.message, "no disk");
  EXPECT_EQ(failures->at(0).command.find("sheaf render scene.pbrt --crop "), 0u);
  EXPECT_TRUE(absl::IsNotFound(server_->farm().view().ListFailures("99").status()));
  EXPECT_TRUE(absl::IsNotFound(server_->farm().view().ListFailures("x").status()));
}

TEST_F(CoordinatorServerTest, FailuresSurviveRestartsAndRefinements) {
  Start();
  const std::string name = Create(Request(64)).name();
  const std::string id = name.substr(std::string("jobs/").size());
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  worker.ReportFailure(worker.leases().at(0).lease_id(), v1::LeaseFailure::KIND_INFRASTRUCTURE,
                       "no disk");
  ASSERT_TRUE(worker.Synchronize(0).ok());
  const std::string command = server_->farm().view().ListFailures(id)->at(0).command;
  const auto expect_kept = [&] {
    const auto failures = server_->farm().view().ListFailures(id);
    ASSERT_TRUE(failures.ok());
    ASSERT_EQ(failures->size(), 1u);
    EXPECT_EQ(failures->at(0).failure.message, "no disk");
    EXPECT_EQ(failures->at(0).failure.worker_id, "w");
    EXPECT_EQ(failures->at(0).command, command);
    const absl::StatusOr<JobView> job = server_->farm().view().FindJob(id);
    ASSERT_TRUE(job.ok());
    EXPECT_EQ(job->failure_count, 1);
  };
  Start();
  expect_kept();
  ASSERT_TRUE(MakeWorker("v").RenderAll().ok());
  ASSERT_EQ(Watch(name).state(), v1::Job::STATE_SUCCEEDED);
  v1::RefineJobRequest refine;
  refine.set_sample_count(128);
  Control(&v1::JobService::Stub::RefineJob, name, refine);
  expect_kept();
}

TEST_F(CoordinatorServerTest, WatchersGetTheFramesThatHaveChanged) {
  Start();
  constexpr int kFrames = 300;
  v1::CreateJobRequest request = Request(4);
  for (int frame = 2; frame <= kFrames; ++frame) {
    *request.add_frames() = request.frames(0);
    request.mutable_frames(frame - 1)->set_frame_number(frame);
    request.mutable_frames(frame - 1)->mutable_settings()->set_seed(static_cast<uint64_t>(frame));
  }
  const std::string name = Create(request).name();
  grpc::ClientContext context;
  SetDeadline(&context, kPatience);
  v1::WatchJobRequest watch;
  watch.set_name(name);
  watch.set_changes_only(true);
  const auto reader = jobs_->WatchJob(&context, watch);
  v1::Job job;
  ASSERT_TRUE(reader->Read(&job));
  EXPECT_FALSE(job.frames_are_changes());
  EXPECT_EQ(job.frames_size(), kFrames);
  v1::SetJobPriorityRequest priority;
  for (int i = 1; i <= 3; ++i) {
    priority.set_priority(i);
    Control(&v1::JobService::Stub::SetJobPriority, name, priority);
    while (job.priority() != i && reader->Read(&job)) {
      EXPECT_TRUE(job.frames_are_changes());
      EXPECT_EQ(job.frames_size(), 0) << "they are as they were";
    }
  }
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  ASSERT_TRUE(worker.RenderOne().ok());
  int changed = 0;
  while (changed == 0 && reader->Read(&job)) changed = job.frames_size();
  EXPECT_LT(changed, kFrames / 10);
  EXPECT_GT(changed, 0);
  grpc::ClientContext cancelling;
  v1::CancelJobRequest cancel;
  cancel.set_name(name);
  v1::Job cancelled;
  ASSERT_TRUE(jobs_->CancelJob(&cancelling, cancel, &cancelled).ok());
  while (reader->Read(&job)) {
  }
  EXPECT_EQ(job.state(), v1::Job::STATE_CANCELLED);
  EXPECT_FALSE(job.frames_are_changes());
  EXPECT_EQ(job.frames_size(), kFrames) << "the last message has all";
}

TEST_F(CoordinatorServerTest, AllWatchersOfAJobShareOneLookAtIt) {
  Start();
  const std::string name = Create(Request(64)).name();
  const std::string id = name.substr(5);
  JobWatches watches(&server_->farm());
  const std::shared_ptr<JobWatch> first = watches.Of(id), second = watches.Of(id);
  EXPECT_EQ(first, second);
  uint64_t seen_by_first = 0, seen_by_second = 0;
  ASSERT_TRUE(first->Next(&seen_by_first, true)->has_value());
  const uint64_t looks = first->look_count();
  ASSERT_TRUE(second->Next(&seen_by_second, true)->has_value());
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(first->Next(&seen_by_first, true).ok());
    ASSERT_TRUE(second->Next(&seen_by_second, true).ok());
  }
  EXPECT_EQ(first->look_count(), looks) << "nothing has changed";
  EXPECT_FALSE(watches.Of("999")->Next(&seen_by_first, true).ok());
}

TEST_F(CoordinatorServerTest, EndedJobsHaveAnEndTime) {
  Start();
  v1::CreateJobRequest request = Request(64);
  request.mutable_partition()->set_pass_sample_count(4);
  request.mutable_partition()->set_tile_size_px(16);
  const std::string name = Create(request).name();
  const std::string id = name.substr(5);
  // Looks all the time, to catch the moment between the last frame and the farm's notes.
  JobView first_ended;
  std::thread looking([&] {
    const absl::Time deadline = absl::Now() + kPatience;
    while (first_ended.state != JobState::kSucceeded && absl::Now() < deadline) {
      first_ended = *server_->farm().view().FindJob(id);
    }
  });
  EXPECT_TRUE(MakeWorker("w").RenderAll().ok());
  looking.join();
  ASSERT_EQ(first_ended.state, JobState::kSucceeded);
  EXPECT_TRUE(first_ended.end_time.has_value());
  // It no longer changes.
  EXPECT_EQ(server_->farm().view().FindJob(id)->end_time, first_ended.end_time);
}

TEST_F(CoordinatorServerTest, SceneErrorOfTheOnlyWorkerFailsTheJob) {
  Start();
  const std::string name = Create(Request(64)).name();
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  worker.ReportFailure(worker.leases()[0].lease_id(), v1::LeaseFailure::KIND_SCENE,
                       "scene.pbrt:3:1: unknown shape \"torus\"");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const v1::Job job = Watch(name);
  EXPECT_EQ(job.state(), v1::Job::STATE_FAILED);
  EXPECT_THAT(job.failure(), HasSubstr("scene.pbrt:3:1: unknown shape"));
  Start();
  EXPECT_EQ(Get(name).failure(), job.failure());
}

TEST_F(CoordinatorServerTest, OtherProfilesGetNoWorkAndTheJobReportsIt) {
  Start();
  const std::string name = Create(Request(64)).name();
  EXPECT_THAT(Get(name).waiting_reason(), HasSubstr("no worker is connected"));
  SyntheticWorker worker = MakeWorker("w");
  worker.set_numeric_profile("z80");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  EXPECT_TRUE(worker.leases().empty());
  EXPECT_THAT(Get(name).waiting_reason(), HasSubstr("z80"));
}

TEST_F(CoordinatorServerTest, PreviewFollowsTheResults) {
  const std::vector<std::string> kChannels{"R", "stderr.R", "samples"};
  Start();
  v1::CreateJobRequest request = Request(64);
  request.mutable_partition()->set_pass_sample_count(16);
  const std::string id = Create(request).name().substr(5);
  EXPECT_EQ(server_->farm().view().Preview(id, 1, kChannels).status().code(),
            absl::StatusCode::kUnavailable);
  EXPECT_EQ(server_->farm().view().Preview(id, 2, kChannels).status().code(),
            absl::StatusCode::kNotFound);
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  ASSERT_EQ(*worker.RenderOne(), Response::OUTCOME_ACCEPTED);
  absl::StatusOr<PreviewView> preview = absl::UnavailableError("");
  const absl::Time deadline = absl::Now() + kPatience;
  while (!preview.ok() && absl::Now() < deadline) {
    const uint64_t seen = server_->farm().view().ChangeCount();
    preview = server_->farm().view().Preview(id, 1, kChannels);
    if (!preview.ok()) server_->farm().view().WaitForChange(seen, absl::Milliseconds(50));
  }
  ASSERT_TRUE(preview.ok()) << preview.status();
  EXPECT_FALSE(preview->complete);
  EXPECT_EQ(preview->image.channel_names, kChannels);
  double sum = 0;
  for (const float value : *preview->image.Find("R")) sum += static_cast<double>(value);
  EXPECT_GT(sum, 0);
  EXPECT_EQ(server_->farm().view().Preview(id, 1, {"no such"}).status().code(),
            absl::StatusCode::kInternal);
  ASSERT_TRUE(worker.RenderAll().ok());
  Watch("jobs/" + id);
  preview = server_->farm().view().Preview(id, 1, kChannels);
  ASSERT_TRUE(preview.ok()) << preview.status();
  EXPECT_TRUE(preview->complete);
  EXPECT_EQ(preview->image.channel_names, kChannels);
}

TEST_F(CoordinatorServerTest, ContentRoundTripsOverGrpc) {
  Start();
  const auto content = v1::ContentService::NewStub(server_->InProcessChannel());
  const std::string bytes(3'000'000, 'x');
  v1::Digest digest;
  digest.set_sha256_hex(Sha256Hex(bytes));
  digest.set_size_bytes(bytes.size());
  const auto missing = [&] {
    grpc::ClientContext context;
    v1::FindMissingRequest request;
    *request.add_digests() = digest;
    v1::FindMissingResponse response;
    EXPECT_TRUE(content->FindMissing(&context, request, &response).ok());
    return response.missing_size();
  };
  // Uploads bytes[from, to) and returns the call's code.
  const auto upload = [&](size_t from, size_t to) {
    grpc::ClientContext context;
    v1::WriteBlobResponse response;
    const auto writer = content->WriteBlob(&context, &response);
    for (size_t offset = from; offset < to; offset += kBlobChunkBytesMax) {
      v1::WriteBlobRequest request;
      if (offset == from) *request.mutable_digest() = digest;
      request.set_offset_bytes(from);
      request.set_zstd_chunk(
          CompressChunk(bytes.substr(offset, std::min(kBlobChunkBytesMax, to - offset))));
      if (!writer->Write(request)) break;
    }
    writer->WritesDone();
    return writer->Finish().error_code();
  };
  EXPECT_EQ(missing(), 1);
  EXPECT_EQ(upload(0, 2'000'000), grpc::StatusCode::INVALID_ARGUMENT);  // Broken off.
  grpc::ClientContext context;
  v1::GetWriteStatusRequest status_request;
  *status_request.mutable_digest() = digest;
  v1::GetWriteStatusResponse status;
  ASSERT_TRUE(content->GetWriteStatus(&context, status_request, &status).ok());
  EXPECT_EQ(status.committed_bytes(), 2'000'000u);
  EXPECT_EQ(upload(1'000'000, bytes.size()), grpc::StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(upload(status.committed_bytes(), bytes.size()), grpc::StatusCode::OK);
  EXPECT_EQ(missing(), 0);
  EXPECT_EQ(upload(0, bytes.size()), grpc::StatusCode::OK);  // Repeated: a no-op.
  grpc::ClientContext read_context;
  v1::ReadBlobRequest read;
  *read.mutable_digest() = digest;
  read.set_offset_bytes(5);
  const auto reader = content->ReadBlob(&read_context, read);
  std::string back;
  v1::ReadBlobResponse chunk;
  while (reader->Read(&chunk)) back += *DecompressChunk(chunk.zstd_chunk(), kBlobChunkBytesMax);
  EXPECT_TRUE(reader->Finish().ok());
  EXPECT_EQ(back, bytes.substr(5));
}

TEST_F(CoordinatorServerTest, HealthAndHttpRespond) {
  options_.http_address = "127.0.0.1:0";
  Start();
  EXPECT_NE(server_->http_port(), 0);
  grpc::ClientContext context;
  SetDeadline(&context, kPatience);
  // The request is an empty message, the response one whose field 1 is 1: SERVING.
  grpc::GenericStub stub(server_->InProcessChannel());
  const grpc::Slice empty;
  grpc::ByteBuffer request(&empty, 1), response;
  grpc::CompletionQueue queue;
  const auto call =
      stub.PrepareUnaryCall(&context, "/grpc.health.v1.Health/Check", request, &queue);
  call->StartCall();
  grpc::Status status;
  call->Finish(&response, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  ASSERT_TRUE(queue.Next(&tag, &ok));
  ASSERT_TRUE(status.ok()) << status.error_message();
  std::vector<grpc::Slice> slices;
  ASSERT_TRUE(response.Dump(&slices).ok());
  ASSERT_EQ(slices.size(), 1u);
  EXPECT_EQ(std::string(slices[0].begin(), slices[0].end()), std::string("\x08\x01"));
}

TEST_F(CoordinatorServerTest, SecondCoordinatorOnTheSameStateIsRefused) {
  Start();
  const absl::Status status = CoordinatorServer::Start(options_).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()), HasSubstr("another coordinator"));
}

TEST_F(CoordinatorServerTest, PortInUseAndOpenAddressAreRefused) {
  options_.listen_address = "127.0.0.1:0";
  Start();
  ASSERT_NE(server_->port(), 0);
  CoordinatorOptions second = options_;
  second.farm.state_directory = directory_ + "/second";
  second.listen_address = absl::StrCat("127.0.0.1:", server_->port());
  absl::Status status = CoordinatorServer::Start(second).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(status.message()), HasSubstr(second.listen_address));
  second.listen_address = "0.0.0.0:0";
  status = CoordinatorServer::Start(second).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()), HasSubstr("--insecure-allow-remote"));
}

}  // namespace
}  // namespace sheaf::coordinator
