// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Altered files of the state directory: each is detected when it is requested, reported by name,
// and repaired.
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/content/chunk_codec.h"
#include "common/film/exr/exr_codec.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "sheaf/v1/content.grpc.pb.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

// Changes one byte in the middle, and nothing that a look at the size would show.
void Alter(const std::string& path) {
  ::chmod(path.c_str(), 0644);
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  const auto middle = static_cast<std::streamoff>(std::filesystem::file_size(path) / 2);
  file.seekg(middle);
  const char byte = static_cast<char>(file.get() ^ 0x55);
  file.seekp(middle);
  file.put(byte);
  ASSERT_TRUE(file.good()) << path;
}

bool Eventually(const std::function<bool()>& condition) {
  const absl::Time deadline = absl::Now() + kPatience;
  while (!condition()) {
    if (absl::Now() > deadline) return false;
    absl::SleepFor(absl::Milliseconds(20));
  }
  return true;
}

class DamageTest : public CoordinatorServerTest {
 protected:
  grpc::StatusCode ReadBlob(const BlobDigest& digest) {
    const auto content = v1::ContentService::NewStub(server_->InProcessChannel());
    grpc::ClientContext context;
    v1::ReadBlobRequest request;
    request.mutable_digest()->set_sha256_hex(digest.sha256_hex);
    request.mutable_digest()->set_size_bytes(digest.size_bytes);
    const auto reader = content->ReadBlob(&context, request);
    v1::ReadBlobResponse chunk;
    while (reader->Read(&chunk)) {
    }
    return reader->Finish().error_code();
  }
  std::string Reason(const v1::Job& job) { return Get(job.name()).waiting_reason(); }
  v1::Job RenderedJob() {
    const v1::Job job = Create(Request(/*samples=*/64));
    EXPECT_TRUE(MakeWorker("w").RenderAll().ok());
    return Watch(job.name());
  }
  // Asks for the image until it is there, as a worker renders what is needed.
  std::string Remade() {
    SyntheticWorker worker = MakeWorker("v");
    absl::StatusOr<std::string> path;
    Eventually([&] {
      EXPECT_TRUE(worker.RenderAll().ok());
      path = server_->farm().images().Find(1, 1);
      return path.ok();
    });
    EXPECT_TRUE(path.ok()) << path.status();
    return path.ok() ? ImageDigest(*ReadFrameImage(*path)) : "";
  }
};

TEST_F(DamageTest, JobsWaitForLostBlobsAndContinue) {
  Start();
  const v1::Job job = Create(Request(/*samples=*/64));
  const BlobStore& blobs = server_->farm().blobs();
  const BlobDigest file = *blobs.Put("a scene");
  Alter(*blobs.PathOf(file));
  EXPECT_EQ(ReadBlob(file), grpc::StatusCode::DATA_LOSS);
  ASSERT_TRUE(Eventually([&] { return !Reason(job).empty() && Reason(job)[0] == 'f'; }));
  EXPECT_THAT(Reason(job), HasSubstr(absl::StrCat("file scene.pbrt (blob ", file.sha256_hex)));
  EXPECT_THAT(Reason(job), HasSubstr("submit the scene again"));
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  EXPECT_TRUE(worker.leases().empty());
  EXPECT_EQ(Counter("sheaf_scenes_lost_total"), 1);
  Create(Request(/*samples=*/64, "request-2"));  // Brings the scene.
  ASSERT_TRUE(Eventually([&] { return Reason(job).empty(); }));
  ASSERT_TRUE(worker.RenderAll().ok());
  EXPECT_EQ(Watch(job.name()).frames(0).image_digest(), ExpectedDigest(64));
}

TEST_F(DamageTest, BlobsLostBeforeARestartAreReported) {
  Start();
  const v1::Job job = Create(Request(/*samples=*/64));
  const BlobDigest file = *server_->farm().blobs().Put("a scene");
  std::filesystem::remove(*server_->farm().blobs().PathOf(file));
  Start();
  EXPECT_EQ(ReadBlob(file), grpc::StatusCode::NOT_FOUND);
  EXPECT_TRUE(Eventually([&] { return Reason(job).find("scene.pbrt") != std::string::npos; }));
}

TEST_F(DamageTest, DamagedManifestsAreRequestedAgain) {
  Start();
  const v1::CreateJobRequest request = Request(/*samples=*/64);
  const v1::Digest& scene = request.frames(0).scene();
  const BlobStore& blobs = server_->farm().blobs();
  Alter(*blobs.PathOf({scene.sha256_hex(), scene.size_bytes()}));
  v1::Job job;
  const grpc::Status status = TryCreate(request, &job);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("is not uploaded"));
  EXPECT_TRUE(TryCreate(Request(/*samples=*/64), &job).ok());
}

TEST_F(DamageTest, AlteredImagesAreRemadeFromParts) {
  Start();
  const v1::Job job = RenderedJob();
  const double accepted = Counter("sheaf_results_accepted_total");
  const std::string path = *server_->farm().images().Find(1, 1);
  Alter(path);
  const absl::Status status = server_->farm().images().Find(1, 1).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()), HasSubstr("being recreated"));
  EXPECT_EQ(Remade(), ExpectedDigest(64));
  EXPECT_EQ(Counter("sheaf_results_accepted_total"), accepted) << "its parts are there";
  EXPECT_EQ(Counter("sheaf_images_damaged_total"), 1);
  EXPECT_TRUE(std::filesystem::exists(directory_ + "/damaged/job-1-frame-1.exr"));
  EXPECT_EQ(Watch(job.name()).state(), v1::Job::STATE_SUCCEEDED);
}

TEST_F(DamageTest, MissingImagesAreRemadeEvenWithoutSomeParts) {
  Start();
  RenderedJob();
  const double accepted = Counter("sheaf_results_accepted_total");
  const std::string path = *server_->farm().images().Find(1, 1);
  // Some later block would be cut again, into two tasks.
  const auto is_first_block = [](const std::filesystem::path& part) {
    return part.string().find("-0-") != std::string::npos;
  };
  const std::filesystem::directory_iterator parts(directory_ + "/parts/1/1");
  Alter(std::find_if(begin(parts), end(parts), is_first_block)->path().string());
  Start();
  std::filesystem::remove(path);
  EXPECT_FALSE(server_->farm().images().Find(1, 1).ok());
  EXPECT_EQ(Remade(), ExpectedDigest(64));
  EXPECT_EQ(Counter("sheaf_results_accepted_total"), 1)
      << "one part was rendered again of " << accepted;
}

TEST_F(DamageTest, PreviewsNeverShowAlteredImages) {
  Start();
  RenderedJob();
  Alter(*server_->farm().images().Find(1, 1));
  EXPECT_EQ(server_->farm().view().Preview("1", 1, {"R"}).status().code(),
            absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Remade(), ExpectedDigest(64));
}

}  // namespace
}  // namespace sheaf::coordinator
