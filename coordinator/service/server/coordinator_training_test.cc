// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Guided frames: one task trains their guiding field, and everything else of them is rendered with
// it.
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/digest.h"
#include "gtest/gtest.h"
#include "tests/support/farm/coordinator_server_fixture.h"

namespace sheaf::coordinator {
namespace {

using Response = v1::UploadResultsResponse;

v1::CreateJobRequest Guided(v1::CreateJobRequest request,
                            v1::Techniques techniques = v1::TECHNIQUES_CAMERA_GUIDED) {
  request.mutable_frames(0)->mutable_settings()->set_techniques(techniques);
  request.mutable_partition()->set_tile_size_px(16);
  request.mutable_partition()->set_lease_pass_count(1);
  return request;
}

class TrainingTest : public CoordinatorServerTest {
 protected:
  std::string FieldPath() const {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(directory_)) {
      if (entry.path().extension() == ".field") return entry.path().string();
    }
    return "";
  }
  // Leases the training to the worker and has it delivered.
  void Train(SyntheticWorker* worker) {
    ASSERT_TRUE(worker->Synchronize(1).ok());
    ASSERT_EQ(worker->leases().size(), 1u);
    ASSERT_EQ(worker->leases()[0].key().kind(), v1::TASK_KIND_TRAINING);
    ASSERT_EQ(*worker->RenderOne(), Response::OUTCOME_ACCEPTED);
  }
  // Has the workers render in turns until the job's image is the one that is expected.
  void ExpectImage(const std::string& name, const std::string& expected,
                   const std::vector<SyntheticWorker*>& workers) {
    const absl::Time deadline = absl::Now() + kPatience;
    while (absl::Now() < deadline && Get(name).frames(0).image_digest() != expected) {
      for (SyntheticWorker* worker : workers) worker->RenderAll().status().IgnoreError();
      absl::SleepFor(absl::Milliseconds(10));
    }
    EXPECT_EQ(Get(name).frames(0).image_digest(), expected);
  }
};

TEST_F(TrainingTest, TrainsOnceAndFirst) {
  Start();
  int number = 0;
  for (const v1::Techniques techniques :
       {v1::TECHNIQUES_CAMERA_GUIDED, v1::TECHNIQUES_CAMERA_AND_LIGHT_GUIDED}) {
    v1::CreateJobRequest request = Guided(Request(37), techniques);
    request.set_request_id(absl::StrCat("guided-", ++number));
    const std::string expected = DigestOf(request.frames(0).settings());
    EXPECT_NE(expected, ExpectedDigest(37));
    const v1::Job job = Create(request);
    SyntheticWorker worker = MakeWorker(absl::StrCat("w", number));
    ASSERT_TRUE(worker.Synchronize(8).ok());
    ASSERT_EQ(worker.leases().size(), 1u);
    const v1::Lease training = worker.leases()[0];
    EXPECT_EQ(training.key().kind(), v1::TASK_KIND_TRAINING);
    EXPECT_EQ(training.key().tile().DebugString(),
              request.frames(0).settings().window().DebugString());
    EXPECT_EQ(training.key().block().count(), 1u);
    EXPECT_FALSE(training.has_guiding_field());
    ASSERT_EQ(*worker.RenderOne(), Response::OUTCOME_ACCEPTED);
    ASSERT_TRUE(worker.Synchronize(8).ok());
    EXPECT_EQ(Get(job.name()).progress().sample_count_done(), 0u);
    EXPECT_EQ(Get(job.name()).progress().ray_count(), 10u);
    ASSERT_GT(worker.leases().size(), 1u);
    for (const v1::Lease& lease : worker.leases()) {
      EXPECT_NE(lease.key().kind(), v1::TASK_KIND_TRAINING);
      EXPECT_EQ(lease.guiding_field().sha256_hex(), Sha256Hex(SyntheticField(0)));
      EXPECT_EQ(*worker.ReadField(lease), SyntheticField(0));
    }
    ASSERT_TRUE(worker.RenderAll().ok());
    const v1::Job after = Watch(job.name());
    EXPECT_EQ(after.frames(0).image_digest(), expected);
    EXPECT_EQ(after.progress().sample_count_done(), after.progress().sample_count_total());
    EXPECT_EQ(after.frames(0).tile_count(), 9u);
    EXPECT_EQ(Counter("sheaf_fields_trained_total"), number);
  }
}

TEST_F(TrainingTest, OtherFramesFillTheGap) {
  Start();
  Create(Guided(Request(16)));
  const v1::Job other = Create(Request(16, "request-2"));
  SyntheticWorker trainer = MakeWorker("trainer"), worker = MakeWorker("worker");
  ASSERT_TRUE(trainer.Synchronize(1).ok());
  ASSERT_EQ(trainer.leases()[0].key().kind(), v1::TASK_KIND_TRAINING);
  ASSERT_TRUE(worker.Synchronize(1).ok());
  ASSERT_EQ(worker.leases().size(), 1u);
  EXPECT_EQ(worker.leases()[0].frame_name(), other.name() + "/frames/1");
}

TEST_F(TrainingTest, FieldsSurviveARestart) {
  Start();
  const v1::CreateJobRequest request = Guided(Request(64));
  const std::string expected = DigestOf(request.frames(0).settings());
  const v1::Job job = Create(request);
  SyntheticWorker worker = MakeWorker("w");
  Train(&worker);
  ASSERT_TRUE(worker.Synchronize(1).ok());
  ASSERT_EQ(*worker.RenderOne(), Response::OUTCOME_ACCEPTED);
  Start();
  SyntheticWorker later = MakeWorker("v");
  ASSERT_TRUE(later.RenderAll().ok());
  EXPECT_EQ(Watch(job.name()).frames(0).image_digest(), expected);
  EXPECT_EQ(Counter("sheaf_fields_trained_total"), 0);
}

TEST_F(TrainingTest, FieldsGoWithTheJobsParts) {
  Start();
  const v1::Job job = Create(Guided(Request(64)));
  SyntheticWorker worker = MakeWorker("w");
  Train(&worker);
  EXPECT_NE(FieldPath(), "");
  Control<v1::CancelJobRequest>(&v1::JobService::Stub::CancelJob, job.name());
  EXPECT_EQ(FieldPath(), "");
}

TEST_F(TrainingTest, LostFieldsAreTrainedAgain) {
  for (const bool restarts : {false, true}) {
    server_.reset();
    std::filesystem::remove_all(directory_);
    Start();
    const v1::CreateJobRequest request = Guided(Request(64));
    const std::string expected = DigestOf(request.frames(0).settings());
    const v1::Job job = Create(request);
    SyntheticWorker worker = MakeWorker("w");
    Train(&worker);
    ASSERT_TRUE(worker.Synchronize(2).ok());
    ASSERT_EQ(*worker.RenderOne(), Response::OUTCOME_ACCEPTED);
    const v1::Lease held = worker.leases()[0];
    std::filesystem::remove(FieldPath());
    if (restarts) {
      Start();
    } else {
      EXPECT_EQ(worker.ReadField(held).status().code(), absl::StatusCode::kNotFound);
      EXPECT_EQ(worker.ReadField(held).status().code(), absl::StatusCode::kNotFound);
      worker.ReportFailure(held.lease_id(), v1::LeaseFailure::KIND_RELEASED, "");
      ASSERT_TRUE(worker.Synchronize(0).ok());
    }
    EXPECT_EQ(Counter("sheaf_parts_revoked_total"), 1);
    SyntheticWorker later = MakeWorker("v");
    Train(&later);
    ASSERT_TRUE(later.RenderAll().ok());
    EXPECT_EQ(Watch(job.name()).frames(0).image_digest(), expected);
    // The part from before the loss stays: it was made with the same bits.
    EXPECT_EQ(Counter("sheaf_results_superseded_total"), 0);
  }
}

TEST_F(TrainingTest, DamagedFieldsAreTrainedAgain) {
  Start();
  const v1::Job job = Create(Guided(Request(64)));
  SyntheticWorker worker = MakeWorker("w");
  Train(&worker);
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const v1::Lease lease = worker.leases()[0];
  const std::string path = FieldPath();
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  std::fstream(path, std::ios::binary | std::ios::in | std::ios::out) << "F";
  EXPECT_EQ(worker.ReadField(lease).status().code(), absl::StatusCode::kNotFound);
  worker.ReportFailure(lease.lease_id(), v1::LeaseFailure::KIND_RELEASED, "");
  ASSERT_TRUE(worker.Synchronize(0).ok());
  Train(&worker);
}

TEST_F(TrainingTest, ResultsOfOtherFieldsAreRefused) {
  Start();
  Create(Guided(Request(64)));
  SyntheticWorker worker = MakeWorker("w");
  Train(&worker);
  ASSERT_TRUE(worker.Synchronize(2).ok());
  const v1::Lease lease = worker.leases()[0];
  SyntheticWorker::Upload bent = worker.MakeUpload(lease);
  bent.header.mutable_guiding_field()->set_sha256_hex(Sha256Hex("another"));
  EXPECT_EQ(worker.Send(bent).status().code(), absl::StatusCode::kInvalidArgument);
  bent.header.clear_guiding_field();
  EXPECT_EQ(worker.Send(bent).status().code(), absl::StatusCode::kInvalidArgument);
  bent.header.mutable_guiding_field()->set_sha256_hex("no digest");
  EXPECT_EQ(worker.Send(bent).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Counter("sheaf_results_other_field_total"), 2);
  EXPECT_EQ(*worker.Send(worker.MakeUpload(lease)), Response::OUTCOME_ACCEPTED);
}

TEST_F(TrainingTest, FieldsWithoutBytesOrTooLargeAreRefused) {
  Start();
  Create(Guided(Request(64)));
  SyntheticWorker worker = MakeWorker("w");
  ASSERT_TRUE(worker.Synchronize(1).ok());
  const v1::Lease training = worker.leases()[0];
  for (const size_t size : {size_t{0}, kGuidingFieldBytesMax + 1}) {
    SyntheticWorker::Upload bent = worker.MakeUpload(training);
    bent.bytes = std::string(size, 'x');
    bent.header.mutable_digest()->set_sha256_hex(Sha256Hex(bent.bytes));
    bent.header.mutable_digest()->set_size_bytes(size);
    EXPECT_EQ(worker.Send(bent).status().code(), absl::StatusCode::kInvalidArgument) << size;
  }
  EXPECT_EQ(FieldPath(), "");
}

// Checks are off, but a field that differs from the lost one removes the parts made with the lost
// one.
TEST_F(TrainingTest, PartsOfALostFalseFieldAreRemoved) {
  Start();
  const v1::CreateJobRequest request = Guided(Request(64));
  const std::string name = Create(request).name();
  SyntheticWorker liar = MakeWorker("liar"), honest = MakeWorker("honest");
  liar.set_falsify([](FilmTile*) {});
  Train(&liar);
  ASSERT_TRUE(honest.Synchronize(2).ok());
  ASSERT_EQ(*honest.RenderOne(), Response::OUTCOME_ACCEPTED);
  const v1::Lease held = honest.leases()[0];
  std::filesystem::remove(FieldPath());
  EXPECT_FALSE(honest.ReadField(held).ok());
  honest.ReportFailure(held.lease_id(), v1::LeaseFailure::KIND_RELEASED, "");
  ExpectImage(name, DigestOf(request.frames(0).settings()), {&honest});
}

TEST_F(TrainingTest, FalseFieldsAreRemovedWithAllThatWasMadeWithThem) {
  options_.farm.limits.check_fraction = 1e-9;  // No other task is chosen.
  options_.farm.limits.new_identity_check_fraction = 0;
  Start();
  const v1::CreateJobRequest request = Guided(Request(64));
  const std::string name = Create(request).name();
  SyntheticWorker liar = MakeWorker("liar"), b = MakeWorker("b"), c = MakeWorker("c");
  liar.set_falsify([](FilmTile*) {});
  ASSERT_TRUE(b.Synchronize(0).ok());
  ASSERT_TRUE(c.Synchronize(0).ok());
  Train(&liar);
  EXPECT_EQ(Counter("sheaf_checks_begun_total"), 1);
  // b renders with the false field while it checks it.
  ASSERT_TRUE(b.Synchronize(3).ok());
  ASSERT_EQ(b.leases().size(), 3u);
  EXPECT_EQ(b.leases()[0].key().kind(), v1::TASK_KIND_TRAINING);
  const SyntheticWorker::Upload late = b.MakeUpload(b.leases()[2]);
  ASSERT_EQ(*b.Send(b.MakeUpload(b.leases()[1])), Response::OUTCOME_ACCEPTED);
  ASSERT_EQ(*b.Send(b.MakeUpload(b.leases()[0])), Response::OUTCOME_DUPLICATE_MISMATCH);
  ASSERT_TRUE(c.Synchronize(1).ok());
  ASSERT_EQ(c.leases()[0].key().kind(), v1::TASK_KIND_TRAINING) << "a third one decides";
  ASSERT_EQ(*c.RenderOne(), Response::OUTCOME_DUPLICATE_MISMATCH) << "than the liar's";
  EXPECT_EQ(liar.Synchronize(1).code(), absl::StatusCode::kPermissionDenied);
  const absl::Time deadline = absl::Now() + kPatience;
  while (Counter("sheaf_parts_revoked_total") < 2 && absl::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(10));
  }
  EXPECT_EQ(Counter("sheaf_parts_revoked_total"), 2) << "the field and b's part";
  EXPECT_EQ(b.Send(late).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Counter("sheaf_results_other_field_total"), 1);
  ExpectImage(name, DigestOf(request.frames(0).settings()), {&b, &c});
  EXPECT_TRUE(b.Synchronize(0).ok()) << "its results with the false field are honest";
}

TEST_F(TrainingTest, RefinementsKeepTheFieldOrTrainItAgain) {
  for (const bool keeps : {true, false}) {
    server_.reset();
    std::filesystem::remove_all(directory_);
    options_.farm.kept_parts_bytes_max = keeps ? uint64_t{1} << 30 : 0;
    Start();
    v1::CreateJobRequest request = Guided(Request(16));
    const std::string name = Create(request).name();
    ASSERT_TRUE(MakeWorker("w").RenderAll().ok());
    ASSERT_EQ(Watch(name).state(), v1::Job::STATE_SUCCEEDED);
    v1::RefineJobRequest refinement;
    refinement.set_sample_count(64);
    Control(&v1::JobService::Stub::RefineJob, name, refinement);
    request.mutable_frames(0)->mutable_settings()->set_sample_count(64);
    SyntheticWorker later = MakeWorker("v");
    ExpectImage(name, DigestOf(request.frames(0).settings()), {&later});
    EXPECT_EQ(Counter("sheaf_fields_trained_total"), keeps ? 1 : 2);
  }
}

}  // namespace
}  // namespace sheaf::coordinator
