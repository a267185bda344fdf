// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The coordinator as its clients and workers meet it: over gRPC, in process, with a state
// directory.
#include "coordinator/service/coordinator_server.h"

#include <grpcpp/generic/generic_stub.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/digest.h"
#include "common/content/chunk_codec.h"
#include "common/film/exr_codec.h"
#include "common/rpc/channel.h"
#include "common/rpc/manifest_codec.h"
#include "coordinator/service/synthetic_worker.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using Response = v1::UploadResultsResponse;
using ::testing::HasSubstr;

constexpr absl::Duration kPatience = absl::Seconds(20);

class CoordinatorServerTest : public testing::Test {
 protected:
  CoordinatorServerTest() {
    directory_ = testing::TempDir() + "sheaf-server-" +
                 testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
    options_.farm.state_directory = directory_;
    options_.farm.preview_interval_min = absl::Milliseconds(1);
    options_.listen_address = "";
  }
  ~CoordinatorServerTest() override {
    server_.reset();
    std::filesystem::remove_all(directory_);
  }

  void Start() {
    server_.reset();
    absl::StatusOr<std::unique_ptr<CoordinatorServer>> server = CoordinatorServer::Start(options_);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = std::move(*server);
    jobs_ = v1::JobService::NewStub(server_->InProcessChannel());
  }

  SyntheticWorker MakeWorker(const std::string& id) { return {server_->InProcessChannel(), id}; }

  static v1::FrameSettings Settings(uint64_t samples, uint64_t seed = 0) {
    v1::FrameSettings settings;
    settings.set_width_px(50);
    settings.set_height_px(40);
    // A crop that no tile edge meets.
    settings.mutable_window()->set_x0_px(3);
    settings.mutable_window()->set_y0_px(5);
    settings.mutable_window()->set_x1_px(44);
    settings.mutable_window()->set_y1_px(38);
    settings.set_sample_count(samples);
    settings.set_depth_max(5);
    settings.set_seed(seed);
    return settings;
  }
  static std::string ExpectedDigest(uint64_t samples, uint64_t seed = 0) {
    FrameSettings settings;
    settings.width_px = 50;
    settings.height_px = 40;
    settings.window = {3, 5, 44, 38};
    settings.samples = samples;
    settings.seed = seed;
    return PictureDigest(SyntheticPicture(settings));
  }

  v1::Digest PutScene(const std::string& text = "a scene") {
    const absl::StatusOr<BlobDigest> file = server_->farm().blobs().Put(text);
    EXPECT_TRUE(file.ok()) << file.status();
    const absl::StatusOr<BlobDigest> manifest = server_->farm().blobs().Put(
        EncodeManifest(MakeManifest("scene.pbrt", {{"scene.pbrt", *file}})));
    EXPECT_TRUE(manifest.ok()) << manifest.status();
    v1::Digest wire;
    wire.set_sha256_hex(manifest->sha256_hex);
    wire.set_size_bytes(manifest->size_bytes);
    return wire;
  }

  v1::CreateJobRequest Request(uint64_t samples, const std::string& request_id = "request-1") {
    v1::CreateJobRequest request;
    request.set_request_id(request_id);
    request.set_title("a test");
    v1::FrameSpec* frame = request.add_frames();
    frame->set_frame_number(1);
    *frame->mutable_scene() = PutScene();
    *frame->mutable_settings() = Settings(samples);
    return request;
  }

  grpc::Status TryCreate(const v1::CreateJobRequest& request, v1::Job* job) {
    grpc::ClientContext context;
    return jobs_->CreateJob(&context, request, job);
  }
  v1::Job Create(const v1::CreateJobRequest& request) {
    v1::Job job;
    const grpc::Status status = TryCreate(request, &job);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return job;
  }
  v1::Job Get(const std::string& name) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_name(name);
    v1::Job job;
    const grpc::Status status = jobs_->GetJob(&context, request, &job);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return job;
  }
  // Follows the watch to its end and returns the job's last state.
  v1::Job Watch(const std::string& name) {
    grpc::ClientContext context;
    SetDeadline(&context, kPatience);
    v1::WatchJobRequest request;
    request.set_name(name);
    const auto reader = jobs_->WatchJob(&context, request);
    v1::Job job;
    while (reader->Read(&job)) {
    }
    const grpc::Status status = reader->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
    return job;
  }
  double Counter(const std::string& name) {
    double sum = 0;
    for (const MetricView& metric : server_->farm().Metrics()) {
      if (metric.name == name) sum += metric.value;
    }
    return sum;
  }

  std::string directory_;
  CoordinatorOptions options_;
  std::unique_ptr<CoordinatorServer> server_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
};

TEST_F(CoordinatorServerTest, EveryPartitionGivesTheSamePicture) {
  Start();
  const std::string expected = ExpectedDigest(/*samples=*/38);
  int number = 0;
  for (const int32_t tile : {16, 32, 64}) {
    for (const uint64_t pass : {4, 16, 64}) {
      for (const uint64_t lease : {1, 8}) {
        v1::CreateJobRequest request = Request(38, absl::StrCat("request-", ++number));
        request.mutable_partition()->set_tile_size_px(tile);
        request.mutable_partition()->set_pass_sample_count(pass);
        request.mutable_partition()->set_lease_pass_count(lease);
        const v1::Job job = Create(request);
        const absl::StatusOr<int> accepted = MakeWorker("w").RenderAll();
        ASSERT_TRUE(accepted.ok()) << accepted.status();
        const v1::Job after = Watch(job.name());
        ASSERT_EQ(after.state(), v1::Job::STATE_SUCCEEDED) << after.DebugString();
        EXPECT_EQ(after.frames(0).picture_digest(), expected)
            << "tile " << tile << ", pass " << pass << ", lease " << lease;
        EXPECT_EQ(after.progress().sample_count_done(), 41u * 33u * 38u);
      }
    }
  }
}

TEST_F(CoordinatorServerTest, MergingFromDiskGivesTheSamePicture) {
  options_.farm.merge_bytes_max = 0;
  Start();
  v1::CreateJobRequest request = Request(100);
  request.mutable_partition()->set_tile_size_px(16);
  request.mutable_partition()->set_pass_sample_count(4);
  const v1::Job job = Create(request);
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  EXPECT_EQ(Watch(job.name()).frames(0).picture_digest(), ExpectedDigest(100));
}

TEST_F(CoordinatorServerTest, WorkersAtTheSameTimeGiveTheSamePicture) {
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
  EXPECT_EQ(after.frames(0).picture_digest(), ExpectedDigest(100));
}

TEST_F(CoordinatorServerTest, DeliveredFileHoldsThePictureAndHowToMakeItAgain) {
  Start();
  const v1::Job job = Create(Request(20));
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  const v1::Job after = Watch(job.name());
  ASSERT_EQ(after.state(), v1::Job::STATE_SUCCEEDED);
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
  const absl::StatusOr<FramePicture> picture = ReadPicture(copy);
  ASSERT_TRUE(picture.ok()) << picture.status();
  const FramePicture expected = [] {
    FrameSettings settings;
    settings.width_px = 50;
    settings.height_px = 40;
    settings.window = {3, 5, 44, 38};
    settings.samples = 20;
    return SyntheticPicture(settings);
  }();
  ASSERT_NE(picture->Find("R"), nullptr);
  EXPECT_EQ(*picture->Find("R"), *expected.Find("R"));
  EXPECT_EQ(picture->metadata.at("frameDigest"), after.frames(0).frame_digest());
  EXPECT_EQ(picture->metadata.at("numericProfile"), after.numeric_profile());
}

TEST_F(CoordinatorServerTest, RestartLosesNothingThatWasAcknowledged) {
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
  EXPECT_EQ(after.frames(0).picture_digest(), ExpectedDigest(100));
  EXPECT_EQ(Counter("sheaf_duplicate_equal_total") + Counter("sheaf_superseded_total"), 0);
}

TEST_F(CoordinatorServerTest, DamagedPartIsRenderedAgain) {
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
  EXPECT_EQ(Watch(name).frames(0).picture_digest(), ExpectedDigest(100));
}

TEST_F(CoordinatorServerTest, WhatTheDiskRefusesIsNotAcknowledgedAndTheFarmRecovers) {
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
  EXPECT_FALSE(server_->farm().Ready().ok());
  EXPECT_EQ(Get(name).progress().sample_count_done(), 0u);
  std::filesystem::remove(parts);
  EXPECT_EQ(*worker.Send(upload), Response::OUTCOME_ACCEPTED);
  EXPECT_TRUE(server_->farm().Ready().ok());
}

TEST_F(CoordinatorServerTest, DuplicatesAreEqualOrQuarantine) {
  Start();
  v1::CreateJobRequest request = Request(64);
  request.mutable_partition()->set_pass_sample_count(4);
  Create(request);
  SyntheticWorker worker = MakeWorker("good");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const v1::Lease lease = worker.leases()[0];
  EXPECT_EQ(*worker.Send(worker.MakeUpload(lease)), Response::OUTCOME_ACCEPTED);
  EXPECT_EQ(*worker.Send(worker.MakeUpload(lease)), Response::OUTCOME_DUPLICATE_EQUAL);
  SyntheticWorker bad = MakeWorker("bad");
  ASSERT_TRUE(bad.Synchronize(1).ok());
  v1::Lease bent = lease;
  bent.mutable_settings()->set_seed(77);
  EXPECT_EQ(*bad.Send(bad.MakeUpload(bent)), Response::OUTCOME_DUPLICATE_MISMATCH);
  EXPECT_EQ(Counter("sheaf_duplicate_mismatch_total"), 1);
  const absl::Status refused = bad.Synchronize(1);
  EXPECT_EQ(refused.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_THAT(std::string(refused.message()), HasSubstr("differs"));
  EXPECT_TRUE(worker.Synchronize(1).ok());
}

TEST_F(CoordinatorServerTest, ResultsThatAreNotPartsOfTheirKeyAreRefused) {
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
  EXPECT_EQ(code_of(bent), absl::StatusCode::kInvalidArgument);
  bent = good;
  bent.header.mutable_key()->mutable_block()->set_count(3);
  EXPECT_EQ(code_of(bent), absl::StatusCode::kInvalidArgument);
  bent = good;
  bent.bytes += "tail";
  EXPECT_EQ(code_of(bent), absl::StatusCode::kInvalidArgument);
  bent = good;
  bent.header.mutable_key()->set_frame_digest(std::string(64, 'a'));
  EXPECT_EQ(*worker.Send(bent), Response::OUTCOME_SUPERSEDED);
  EXPECT_EQ(Counter("sheaf_results_accepted_total"), 0);
  EXPECT_EQ(*worker.Send(good), Response::OUTCOME_ACCEPTED);
}

TEST_F(CoordinatorServerTest, JobsAreCheckedAndCreatedOnce) {
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

TEST_F(CoordinatorServerTest, CancelledJobStaysCancelledAndItsResultsAreSuperseded) {
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

TEST_F(CoordinatorServerTest, SceneErrorOfTheOnlyWorkerFailsTheJobWithItsMessage) {
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

TEST_F(CoordinatorServerTest, WorkerOfAnotherProfileGetsNoWorkAndTheJobSaysWhy) {
  Start();
  const std::string name = Create(Request(64)).name();
  EXPECT_THAT(Get(name).waiting_reason(), HasSubstr("no worker is connected"));
  SyntheticWorker worker = MakeWorker("w");
  worker.set_numeric_profile("z80");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  EXPECT_TRUE(worker.leases().empty());
  EXPECT_THAT(Get(name).waiting_reason(), HasSubstr("z80"));
}

TEST_F(CoordinatorServerTest, PreviewGrowsWithTheResults) {
  Start();
  v1::CreateJobRequest request = Request(64);
  request.mutable_partition()->set_pass_sample_count(16);
  const std::string id = Create(request).name().substr(5);
  EXPECT_EQ(server_->farm().Preview(id, 1).status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(server_->farm().Preview(id, 2).status().code(), absl::StatusCode::kNotFound);
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  ASSERT_EQ(*worker.RenderOne(), Response::OUTCOME_ACCEPTED);
  absl::StatusOr<PreviewView> preview = absl::UnavailableError("");
  const absl::Time deadline = absl::Now() + kPatience;
  while (!preview.ok() && absl::Now() < deadline) {
    const uint64_t seen = server_->farm().ChangeCount();
    preview = server_->farm().Preview(id, 1);
    if (!preview.ok()) server_->farm().WaitForChange(seen, absl::Milliseconds(50));
  }
  ASSERT_TRUE(preview.ok()) << preview.status();
  EXPECT_FALSE(preview->complete);
  double sum = 0;
  for (const float value : *preview->picture.Find("R")) sum += static_cast<double>(value);
  EXPECT_GT(sum, 0);
  ASSERT_TRUE(worker.RenderAll().ok());
  Watch("jobs/" + id);
  preview = server_->farm().Preview(id, 1);
  ASSERT_TRUE(preview.ok()) << preview.status();
  EXPECT_TRUE(preview->complete);
}

TEST_F(CoordinatorServerTest, ContentGoesInAndOutOverTheWire) {
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
  EXPECT_EQ(upload(0, bytes.size()), grpc::StatusCode::OK);  // Again: nothing happens.
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

TEST_F(CoordinatorServerTest, HealthAndHttpAnswer) {
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

TEST_F(CoordinatorServerTest, TakenPortAndOpenAddressAreRefused) {
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
