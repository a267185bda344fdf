// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CoordinatorServerTest, for tests: a coordinator in process with a state directory of its own, and
// the calls that its clients make.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>

#include "common/rpc/channel.h"
#include "common/rpc/manifest_codec.h"
#include "common/rpc/settings_codec.h"
#include "coordinator/service/server/coordinator_server.h"
#include "tests/support/farm/synthetic_worker.h"

namespace sheaf::coordinator {

// How long a test waits for an event. Only ends tests that hang: every event takes less than a
// tenth of it.
inline constexpr absl::Duration kPatience = absl::Seconds(200);

class CoordinatorServerTest : public ::testing::Test {
 protected:
  CoordinatorServerTest() {
    directory_ = ::testing::TempDir() + "sheaf-server-" +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
    options_.farm.state_directory = directory_;
    options_.farm.preview_interval_min = absl::Milliseconds(1);
    options_.listen_address = "";
    options_.farm.limits.check_fraction = 0;  // Checks come by chance; they have their own tests.
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

  static v1::FrameSettings Settings(uint64_t samples) {
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
    return settings;
  }
  // The image that the farm must deliver for the settings.
  static FrameImage ImageOf(const v1::FrameSettings& wire) {
    const absl::StatusOr<FrameSettings> settings = sheaf::FromWire(wire);
    EXPECT_TRUE(settings.ok()) << settings.status();
    return settings.ok() ? SyntheticImage(*settings) : FrameImage{};
  }
  static std::string DigestOf(const v1::FrameSettings& wire) { return ImageDigest(ImageOf(wire)); }
  static std::string ExpectedDigest(uint64_t samples) { return DigestOf(Settings(samples)); }

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
  // With its frames.
  v1::Job Create(const v1::CreateJobRequest& request) {
    v1::Job job;
    const grpc::Status status = TryCreate(request, &job);
    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(job.frames_size(), 0) << "there may be many";
    return Get(job.name());
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
  // Changes the job by one of the calls that answer with it.
  template <class Request>
  v1::Job Control(grpc::Status (v1::JobService::Stub::*call)(grpc::ClientContext*, const Request&,
                                                             v1::Job*),
                  const std::string& name, Request request = Request()) {
    grpc::ClientContext context;
    request.set_name(name);
    v1::Job job;
    const grpc::Status status = (jobs_.get()->*call)(&context, request, &job);
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
    for (const MetricView& metric : server_->farm().view().Metrics()) {
      if (metric.name == name) sum += metric.value;
    }
    return sum;
  }

  std::string directory_;
  CoordinatorOptions options_;
  std::unique_ptr<CoordinatorServer> server_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
};

}  // namespace sheaf::coordinator
