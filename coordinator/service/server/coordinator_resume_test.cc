// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Frames that resume delivered images, with synthetic samples, so that the expected image is
// known.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/film/error/compare.h"
#include "common/film/error/error_estimate.h"
#include "common/film/exr/exr_codec.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

class CoordinatorResumeTest : public CoordinatorServerTest {
 protected:
  // Renders what the request asks for and returns the file that is delivered.
  std::string Deliver(const v1::CreateJobRequest& request) {
    const v1::Job job = Create(request);
    EXPECT_TRUE(MakeWorker("w").RenderAll().ok());
    const v1::Job after = Watch(job.name());
    EXPECT_EQ(after.state(), v1::Job::STATE_SUCCEEDED) << after.DebugString();
    return BytesOf(after);
  }
  std::string BytesOf(const v1::Job& job) {
    grpc::ClientContext context;
    v1::ReadFrameOutputRequest request;
    request.set_name(job.frames(0).name());
    const auto reader = jobs_->ReadFrameOutput(&context, request);
    std::string bytes;
    v1::ReadFrameOutputResponse chunk;
    while (reader->Read(&chunk)) bytes += chunk.chunk();
    EXPECT_TRUE(reader->Finish().ok());
    return bytes;
  }
  // A job that resumes the file.
  v1::CreateJobRequest ContinueRequest(const std::string& exr, uint64_t samples,
                                       const std::string& request_id) {
    v1::CreateJobRequest request = Request(samples, request_id);
    const absl::StatusOr<BlobDigest> blob = server_->farm().blobs().Put(exr);
    EXPECT_TRUE(blob.ok()) << blob.status();
    v1::Digest* digest = request.mutable_frames(0)->mutable_resumed_image();
    digest->set_sha256_hex(blob->sha256_hex);
    digest->set_size_bytes(blob->size_bytes);
    return request;
  }
  std::string WhyNot(const v1::CreateJobRequest& request) {
    v1::Job job;
    const grpc::Status status = TryCreate(request, &job);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    return status.error_message();
  }
  // The image equals that of one run, except for the last bits of floats; errors are estimated
  // again.
  static void ExpectAsOneRun(const std::string& exr, uint64_t samples, bool with_light = false) {
    const absl::StatusOr<FrameImage> image = DecodeFrameImage(exr);
    ASSERT_TRUE(image.ok()) << image.status();
    v1::FrameSettings settings = Settings(samples);
    if (with_light) settings.set_techniques(v1::TECHNIQUES_CAMERA_AND_LIGHT);
    const FrameImage whole = ImageOf(settings);
    for (size_t i = 0; i < whole.planes.size(); ++i) {
      const std::string& name = whole.channel_names[i];
      if (name.find("stderr.") != std::string::npos) continue;
      const std::vector<float>* found = image->Find(name);
      ASSERT_NE(found, nullptr) << name;
      for (size_t p = 0; p < found->size(); ++p) {
        const float expected = whole.planes[i][p];
        ASSERT_NEAR((*found)[p], expected, 1e-5f * (1 + std::fabs(expected))) << name;
      }
    }
    const double ratio = EstimateError(*image).relative_mse / EstimateError(whole).relative_mse;
    EXPECT_GT(ratio, 0.8);
    EXPECT_LT(ratio, 1.25);
  }
};

TEST_F(CoordinatorResumeTest, ResumingMatchesOneRun) {
  Start();
  const std::string first = Deliver(Request(64));
  const v1::Job job = Create(ContinueRequest(first, 200, "more"));
  const uint64_t pixels = 41 * 33;
  EXPECT_EQ(job.progress().sample_count_done(), 64 * pixels);
  EXPECT_EQ(job.progress().sample_count_total(), 200 * pixels);
  const double accepted_before = Counter("sheaf_samples_accepted_total");
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  const v1::Job after = Watch(job.name());
  ASSERT_EQ(after.state(), v1::Job::STATE_SUCCEEDED) << after.DebugString();
  EXPECT_EQ(Counter("sheaf_samples_accepted_total") - accepted_before, 136.0 * pixels);
  EXPECT_GT(after.frames(0).flip(), 0);
  const std::string second = BytesOf(after);
  ExpectAsOneRun(second, 200);
  // Continues again, from an image that was itself continued.
  ExpectAsOneRun(Deliver(ContinueRequest(second, 256, "even more")), 256);
  // With nothing left to do it is the same image.
  const v1::Job same = Create(ContinueRequest(second, 200, "the same"));
  EXPECT_EQ(Watch(same.name()).state(), v1::Job::STATE_SUCCEEDED);
  ExpectAsOneRun(BytesOf(same), 200);
}

// Both kinds of path continue, each by its own count.
TEST_F(CoordinatorResumeTest, ResumingLightPathsMatchesOneRun) {
  Start();
  const auto with_light = [](v1::CreateJobRequest request) {
    request.mutable_frames(0)->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA_AND_LIGHT);
    request.mutable_partition()->set_tile_size_px(16);
    return request;
  };
  const std::string first = Deliver(with_light(Request(48)));
  const v1::Job job = Create(with_light(ContinueRequest(first, 200, "more")));
  const uint64_t paths = 41 * 33 + 50 * 40;
  EXPECT_EQ(job.progress().sample_count_done(), 48 * paths);
  EXPECT_EQ(job.progress().sample_count_total(), 200 * paths);
  {
    SyntheticWorker worker = MakeWorker("w");
    ASSERT_TRUE(worker.Synchronize(3).ok());
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(worker.RenderOne().ok());
  }
  Start();
  EXPECT_GE(Get(job.name()).progress().sample_count_done(), 48 * paths);
  for (const char* worker : {"w", "v"}) ASSERT_TRUE(MakeWorker(worker).RenderAll().ok());
  const v1::Job after = Watch(job.name());
  ASSERT_EQ(after.state(), v1::Job::STATE_SUCCEEDED) << after.DebugString();
  EXPECT_GT(after.frames(0).flip(), 0);
  const std::string second = BytesOf(after);
  ExpectAsOneRun(second, 200, true);
  // The same bits from one worker, and by other leases.
  v1::CreateJobRequest again = with_light(ContinueRequest(first, 200, "again"));
  again.mutable_partition()->set_lease_pass_count(1);
  const absl::StatusOr<FrameImage> image = DecodeFrameImage(Deliver(again));
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(ImageDigest(*image), after.frames(0).image_digest());
  // With nothing left to do, and from an image that was itself continued.
  ExpectAsOneRun(Deliver(with_light(ContinueRequest(second, 200, "the same"))), 200, true);
  // To a target, whose rounds bring light passes.
  v1::CreateJobRequest request = with_light(ContinueRequest(first, 1 << 16, "to a target"));
  const double has = EstimateError(*DecodeFrameImage(first)).relative_mse;
  request.mutable_frames(0)->mutable_stop()->set_target_error(has / 4);
  const v1::Job aimed = Create(request);
  const absl::Time deadline = absl::Now() + kPatience;
  v1::Job state = Get(aimed.name());
  while (state.state() != v1::Job::STATE_SUCCEEDED && absl::Now() < deadline) {
    ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
    state = Get(aimed.name());
  }
  ASSERT_EQ(state.state(), v1::Job::STATE_SUCCEEDED) << state.DebugString();
  EXPECT_EQ(state.frames(0).stop_reason(), v1::STOP_REASON_TARGET_ERROR);
  EXPECT_EQ(state.frames(0).rounds(0).sample_count(), 48u * 41 * 33);
  const v1::Job on = Create(with_light(ContinueRequest(BytesOf(state), 1024, "to the end")));
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  EXPECT_EQ(Watch(on.name()).state(), v1::Job::STATE_SUCCEEDED);
  ExpectAsOneRun(BytesOf(on), 1024, true);
}

TEST_F(CoordinatorResumeTest, ImagesWithoutTheirLightLayerAreRefused) {
  Start();
  v1::CreateJobRequest request = Request(16);
  request.mutable_frames(0)->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA_AND_LIGHT);
  FrameImage image = *DecodeFrameImage(Deliver(request));
  const auto why = [&](const std::string& request_id) {
    image.metadata[kImageDigestKey] = ImageDigest(image);
    v1::CreateJobRequest more = ContinueRequest(EncodeFrameImage(image), 64, request_id);
    more.mutable_frames(0)->mutable_settings()->set_techniques(v1::TECHNIQUES_CAMERA_AND_LIGHT);
    return WhyNot(more);
  };
  image.Find("light.samples")->at(7) = 17;
  EXPECT_THAT(why("other passes"), HasSubstr("its light layer contradicts it"));
  const auto at =
      std::find(image.channel_names.begin(), image.channel_names.end(), "light.samples");
  image.planes.erase(image.planes.begin() + (at - image.channel_names.begin()));
  image.channel_names.erase(at);
  EXPECT_THAT(why("no passes"), HasSubstr("has no channel light.samples"));
}

TEST_F(CoordinatorResumeTest, SurvivesRestartsAndIsRefined) {
  Start();
  const std::string first = Deliver(Request(48));
  v1::CreateJobRequest request = ContinueRequest(first, 144, "more");
  request.mutable_partition()->set_tile_size_px(16);
  const v1::Job job = Create(request);
  {
    SyntheticWorker worker = MakeWorker("w");
    ASSERT_TRUE(worker.Synchronize(3).ok());
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(worker.RenderOne().ok());
  }
  Start();
  EXPECT_GE(Get(job.name()).progress().sample_count_done(), 48u * 41 * 33);
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  const v1::Job after = Watch(job.name());
  ASSERT_EQ(after.state(), v1::Job::STATE_SUCCEEDED) << after.DebugString();
  ExpectAsOneRun(BytesOf(after), 144);
  v1::RefineJobRequest refinement;
  refinement.set_sample_count(160);
  Control(&v1::JobService::Stub::RefineJob, job.name(), refinement);
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  ExpectAsOneRun(BytesOf(Watch(job.name())), 160);
}

TEST_F(CoordinatorResumeTest, TargetsCountTheImagesSamples) {
  Start();
  const std::string first = Deliver(Request(64));
  v1::CreateJobRequest request = ContinueRequest(first, 1 << 16, "to a target");
  const double has = EstimateError(*DecodeFrameImage(first)).relative_mse;
  request.mutable_frames(0)->mutable_stop()->set_target_error(has / 4);
  const v1::Job job = Create(request);
  const absl::Time deadline = absl::Now() + kPatience;
  v1::Job after = Get(job.name());
  while (after.state() != v1::Job::STATE_SUCCEEDED && absl::Now() < deadline) {
    ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
    after = Get(job.name());
  }
  ASSERT_EQ(after.state(), v1::Job::STATE_SUCCEEDED) << after.DebugString();
  EXPECT_EQ(after.frames(0).stop_reason(), v1::STOP_REASON_TARGET_ERROR);
  EXPECT_EQ(after.frames(0).rounds(0).sample_count(), 64u * 41 * 33);
  // Tiles have unequal counts now; other tiles cannot resume them.
  const std::string stopped = BytesOf(after);
  v1::CreateJobRequest other = ContinueRequest(stopped, 1 << 16, "other tiles");
  other.mutable_partition()->set_tile_size_px(41);
  EXPECT_THAT(WhyNot(other), HasSubstr("continue with --tile-size 32 --cell-size 4"));
  const v1::Job on = Create(ContinueRequest(stopped, 1024, "to the end"));
  ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
  EXPECT_EQ(Watch(on.name()).state(), v1::Job::STATE_SUCCEEDED);
  ExpectAsOneRun(BytesOf(on), 1024);
}

TEST_F(CoordinatorResumeTest, MismatchedImagesAreRefused) {
  Start();
  const std::string first = Deliver(Request(32));
  EXPECT_THAT(WhyNot(ContinueRequest(first, 16, "few")),
              HasSubstr("has 32 samples per pixel already"));
  v1::CreateJobRequest request = ContinueRequest(first, 64, "scene");
  *request.mutable_frames(0)->mutable_scene() = PutScene("another scene");
  EXPECT_THAT(WhyNot(request), HasSubstr("from another scene"));
  request = ContinueRequest(first, 64, "seed");
  request.mutable_frames(0)->mutable_settings()->set_seed(77);
  EXPECT_THAT(WhyNot(request), HasSubstr("with another seed"));
  request = ContinueRequest(first, 64, "window");
  request.mutable_frames(0)->mutable_settings()->mutable_window()->set_x1_px(40);
  EXPECT_THAT(WhyNot(request), HasSubstr("with another crop"));
  request = ContinueRequest(first, 64, "settings");
  request.mutable_frames(0)->mutable_settings()->set_one_sequence(true);
  EXPECT_THAT(WhyNot(request), HasSubstr("with other settings"));
  EXPECT_THAT(WhyNot(ContinueRequest("no image", 64, "none")),
              HasSubstr("cannot continue from the image"));
  FrameImage changed = *DecodeFrameImage(first);
  changed.planes[0][5] *= 2;
  EXPECT_THAT(WhyNot(ContinueRequest(EncodeFrameImage(changed), 64, "changed")),
              HasSubstr("were changed"));
  request = ContinueRequest(first, 64, "missing");
  request.mutable_frames(0)->mutable_resumed_image()->set_sha256_hex(std::string(64, 'a'));
  v1::Job job;
  const grpc::Status status = TryCreate(request, &job);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("is not uploaded"));
}

}  // namespace
}  // namespace sheaf::coordinator
