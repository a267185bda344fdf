// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the farm's durability with a store that is slow on purpose.
#include "coordinator/service/farm/farm.h"

#include <filesystem>
#include <fstream>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/mutex.h"
#include "common/film/exr/exr_codec.h"
#include "coordinator/service/farm/gated_job_store.h"
#include "coordinator/store/sqlite_job_store.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

// Processor time of a pixel sample.
constexpr absl::Duration kSampleCpu = absl::Nanoseconds(100);

// Some gray, other than those of the samples before.
float GrayOf(uint64_t sample) { return static_cast<float>((sample * 0x9E3779B97F4A7C15u) >> 61); }

// A farm over a gated store, with a job of one tile.
class FarmTest : public testing::Test {
 protected:
  FarmTest() {
    directory_ = testing::TempDir() + "sheaf-farm-" +
                 testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
    Start();
  }
  // Also again.
  void Start() {
    farm_.reset();
    FarmOptions options;
    options.state_directory = directory_;
    auto sqlite = SqliteJobStore::Open(directory_);
    SHEAF_CHECK(sqlite.ok());
    auto gated = std::make_unique<GatedJobStore>(*std::move(sqlite));
    store_ = gated.get();
    auto farm = Farm::Open(options, std::move(gated));
    SHEAF_CHECK(farm.ok());
    farm_ = *std::move(farm);
  }
  ~FarmTest() override {
    store_->Open();
    farm_.reset();
    std::filesystem::remove_all(directory_);
  }
  uint64_t MakeJob(const StopRule& stop, uint64_t samples = 256) {
    JobSpec spec;
    spec.title = "job";
    spec.partition = {16, 16, 1};
    FrameSpec frame;
    frame.frame_number = 1;
    const auto scene = farm_->blobs().Put("a scene");
    SHEAF_CHECK(scene.ok());
    frame.scene = *scene;
    frame.settings.width_px = frame.settings.height_px = 16;
    frame.settings.window = {0, 0, 16, 16};
    frame.settings.samples = samples;
    frame.stop = stop;
    spec.frames = {frame};
    const auto job = farm_->CreateJob(spec, absl::StrCat("request", samples));
    SHEAF_CHECK(job.ok());
    return *job;
  }
  // The leases of a worker that wants one.
  std::vector<LeaseGrant> Lease(const std::string& worker_id) {
    WorkerReport report;
    report.worker_id = report.host = worker_id;
    report.numeric_profile = NumericProfile();
    report.requested_lease_count = 1;
    const auto answer = farm_->Synchronize(report);
    SHEAF_CHECK(answer.ok());
    return answer->leases;
  }
  // Renders samples of a lease, in gray that varies from sample to sample.
  static std::string Render(const LeaseGrant& grant, SampleBlock block) {
    FilmTile tile(grant.lease.tile_rect, block);
    PixelAccumulator accumulator(&tile);
    for (const PixelRect& rect : RectsOf(tile.rect(), grant.lease.cells)) {
      for (int32_t pixel = 0; pixel < rect.PixelCount(); ++pixel) {
        accumulator.Begin(rect.x0 + pixel % rect.Width(), rect.y0 + pixel / rect.Width());
        for (uint64_t i = block.first; i < block.End(); ++i) {
          accumulator.Add(i, {.radiance = Rgb::Gray(GrayOf(i)), .alpha = 1});
        }
        accumulator.End();
      }
    }
    return EncodePart(tile, {grant.frame_digest, NumericProfile(), {}, grant.lease.cells});
  }
  // Renders a lease, and delivers that.
  absl::Status Deliver(const LeaseGrant& grant) {
    const SampleBlock block = grant.lease.task.block;
    const std::string bytes = Render(grant, block);
    ResultReport result;
    result.frame_digest = grant.frame_digest;
    result.tile = grant.lease.tile_rect;
    result.block = block;
    result.cells = grant.lease.cells;
    result.lease_id = grant.lease.lease_id;
    result.token = grant.token;
    result.worker_id = grant.lease.worker_id;
    result.cpu_duration = kSampleCpu * static_cast<double>(grant.lease.tile_rect.PixelCount()) *
                          static_cast<double>(block.count);
    result.digest = {Sha256Hex(bytes), bytes.size()};
    return farm_->AddResult(result, bytes).status();
  }
  // Renders what there is to do, in no less time.
  void Work(absl::Duration time_min = absl::ZeroDuration(),
            absl::StatusCode outcome = absl::StatusCode::kOk) {
    const std::vector<LeaseGrant> grants = Lease("w");
    absl::SleepFor(time_min);
    for (const LeaseGrant& grant : grants) EXPECT_EQ(Deliver(grant).code(), outcome);
  }

  // Changes a byte of each part on disk.
  void DamageParts() {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(directory_ + "/parts")) {
      if (!entry.is_regular_file()) continue;
      std::fstream file(entry.path(), std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(entry.file_size() / 2));
      const auto byte = static_cast<char>(file.peek() ^ 1);
      file.seekp(static_cast<std::streamoff>(entry.file_size() / 2));
      file.put(byte);
    }
  }

  std::string directory_;
  GatedJobStore* store_ = nullptr;
  std::unique_ptr<Farm> farm_;
};

// Also where no worker is left that tries again.
TEST_F(FarmTest, JobsReportAFullDiskAndRecover) {
  store_->Open();
  const std::string job = absl::StrCat(MakeJob({}));
  store_->full_ = true;
  Work(absl::ZeroDuration(), absl::StatusCode::kResourceExhausted);
  EXPECT_FALSE(farm_->Ready().ok());
  EXPECT_THAT(farm_->FindJob(job)->waiting_reason, HasSubstr("no space left"));
  store_->full_ = false;
  const SteadyTime deadline = SteadyTime::Now() + absl::Seconds(60);
  while (!farm_->Ready().ok() && SteadyTime::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(10));
  }
  EXPECT_TRUE(farm_->Ready().ok());
  EXPECT_EQ(farm_->FindJob(job)->waiting_reason, "");
  while (!farm_->FindJob(job)->frames[0].complete && SteadyTime::Now() < deadline) Work();
  EXPECT_TRUE(farm_->FindJob(job)->frames[0].complete);
}

// A part is found damaged while the disk refuses to remove it: the one that is rendered again takes
// its place.
TEST_F(FarmTest, ADamagedPartThatCannotBeRemovedIsReplaced) {
  store_->Open();
  const std::string job = absl::StrCat(MakeJob({}));
  Work();
  DamageParts();
  Start();
  store_->Open();
  store_->keeps_parts_ = true;
  const SteadyTime deadline = SteadyTime::Now() + absl::Seconds(60);
  while (store_->removals_refused_ == 0 && SteadyTime::Now() < deadline) {
    Work(absl::Milliseconds(2));
  }
  EXPECT_GT(store_->removals_refused_, 0);
  store_->keeps_parts_ = false;
  while (!farm_->FindJob(job)->frames[0].complete && SteadyTime::Now() < deadline) {
    Work(absl::Milliseconds(2));
  }
  EXPECT_TRUE(farm_->FindJob(job)->frames[0].complete);
}

// The disk may refuse to remove a part that was superseded while it was written. The next life
// meets it beside those that cover its samples.
TEST_F(FarmTest, StartsWithPartsThatOverlap) {
  store_->Open();
  const std::string job = absl::StrCat(MakeJob({}));
  const std::vector<LeaseGrant> grants = Lease("w");
  ASSERT_EQ(grants.size(), 1u);
  const auto& lease = grants[0].lease;
  ASSERT_TRUE(Deliver(grants[0]).ok());
  const SampleBlock half{lease.task.block.first, lease.task.block.count / 2};
  const std::string bytes = Render(grants[0], half);
  const PartRow row{.key = {lease.frame, lease.tile_rect, half, lease.cells},
                    .digest = {Sha256Hex(bytes), bytes.size()},
                    .worker_id = "w",
                    .cost = {}};
  ASSERT_TRUE(store_->WritePart(row, bytes).ok());
  Start();
  store_->Open();
  const SteadyTime deadline = SteadyTime::Now() + absl::Seconds(60);
  while (!farm_->FindJob(job)->frames[0].complete && SteadyTime::Now() < deadline) {
    Work(absl::Milliseconds(2));
  }
  EXPECT_TRUE(farm_->FindJob(job)->frames[0].complete);
}

// An end that the disk refuses is written later. A job that is refined meanwhile has none: it keeps
// its parts and goes on.
TEST_F(FarmTest, AJobCanBeRefinedBeforeItsEndIsWritten) {
  store_->Open();
  const uint64_t id = MakeJob({});
  const std::string job = absl::StrCat(id);
  const SteadyTime deadline = SteadyTime::Now() + absl::Seconds(60);
  store_->refuses_ends_ = true;
  while (store_->ends_refused_ == 0 && SteadyTime::Now() < deadline) Work(absl::Milliseconds(2));
  ASSERT_TRUE(farm_->RefineJob(id, {{}, 512}).ok());
  store_->refuses_ends_ = false;
  EXPECT_TRUE(farm_->CancelJob(MakeJob({}, 64)).ok());  // Writes all ends that are due.
  ASSERT_GT(store_->PartsBytes(), 0u);
  const auto view = [&] { return *farm_->FindJob(job); };
  while (view().state != JobState::kSucceeded && SteadyTime::Now() < deadline) {
    Work(absl::Milliseconds(2));
  }
  EXPECT_EQ(view().state, JobState::kSucceeded);
  EXPECT_EQ(view().progress.sample_count_done, 16u * 16u * 512u);
}

// A write that failed may be on disk all the same, and come back with the next start. The opposite
// is therefore written, although the job is as it shall be.
TEST_F(FarmTest, ResumeIsWrittenAfterAPauseThatFailed) {
  store_->Open();
  const uint64_t job = MakeJob({});
  store_->full_ = true;
  EXPECT_TRUE(absl::IsResourceExhausted(farm_->PauseJob(job)));
  EXPECT_TRUE(absl::IsResourceExhausted(farm_->SetJobPriority(job, 5)));
  store_->full_ = false;
  EXPECT_TRUE(farm_->ResumeJob(job).ok());
  EXPECT_TRUE(farm_->SetJobPriority(job, 0).ok());
  EXPECT_EQ(store_->control_writes_, 4);
}

// A second call to cancel a job is not answered before the first is durable: after a power cut the
// job would be alive again, although the caller was told otherwise.
TEST_F(FarmTest, SecondCancelWaitsForTheFirst) {
  const uint64_t job = MakeJob({});
  const auto cancel = [&] { return farm_->CancelJob(job); };
  std::future<absl::Status> first = std::async(std::launch::async, cancel);
  store_->WaitUntilSomeoneIsThere();
  std::future<absl::Status> second = std::async(std::launch::async, cancel);
  EXPECT_EQ(second.wait_for(std::chrono::milliseconds(200)), std::future_status::timeout);
  store_->Open();
  EXPECT_TRUE(first.get().ok());
  EXPECT_TRUE(second.get().ok());
}

// Results of one tile are taken one at a time. The sender of one that waits may be found to make
// false results meanwhile, and those are removed: then this one is not taken any more.
TEST_F(FarmTest, AResultThatWaitsIsRefusedWhereItsSenderIsQuarantined) {
  MakeJob({});
  const std::vector<LeaseGrant> honest = Lease("honest"), liar = Lease("liar");
  ASSERT_EQ(honest.size(), 1u);
  ASSERT_EQ(liar.size(), 1u);
  store_->holds_parts_ = true;
  const auto deliver = [&](const LeaseGrant& grant) {
    return std::async(std::launch::async, [&] { return Deliver(grant); });
  };
  std::future<absl::Status> under_way = deliver(honest[0]);
  store_->WaitUntilSomeoneIsThere();
  std::future<absl::Status> waiting = deliver(liar[0]);
  EXPECT_EQ(waiting.wait_for(std::chrono::milliseconds(200)), std::future_status::timeout);
  {
    const MutexLock lock(&farm_->tables().mutex);
    farm_->tables().scheduler.Quarantine("liar", "it lied", /*made_false_results=*/true);
  }
  store_->Open();
  EXPECT_TRUE(under_way.get().ok());
  EXPECT_EQ(waiting.get().code(), absl::StatusCode::kPermissionDenied);
}

// A view during the decision of the first round shows a frame without rounds.
TEST_F(FarmTest, JobsAreReadableDuringRoundDecisions) {
  const std::string job = absl::StrCat(MakeJob({.target_error = 1e-6}));
  Work();
  store_->WaitUntilSomeoneIsThere();
  const auto before = farm_->FindJob(job);
  ASSERT_TRUE(before.ok());
  EXPECT_TRUE(before->frames[0].rounds.empty());
  EXPECT_EQ(before->progress.sample_count_done, 16u * 256u);
  store_->Open();
  const absl::Time deadline = absl::Now() + absl::Seconds(20);
  uint64_t seen = 0;
  while (farm_->FindJob(job)->frames[0].rounds.empty() && absl::Now() < deadline) {
    seen = farm_->WaitForChange(seen, absl::Seconds(1));
  }
  const auto after = farm_->FindJob(job);
  ASSERT_EQ(after->frames[0].rounds.size(), 1u);
  EXPECT_GT(after->progress.sample_count_total, 16u * 256u);
}

// A rate is all samples over the time that they took, also in the life after.
TEST_F(FarmTest, RefinedJobTimeCoversAllSamples) {
  store_->Open();
  const uint64_t id = MakeJob({});
  const std::string job = absl::StrCat(id);
  const absl::Time deadline = absl::Now() + absl::Seconds(60);
  const auto finish = [&](absl::Duration first_work_time) {
    Work(first_work_time);
    const auto view = [&] { return *farm_->FindJob(job); };
    while (view().state != JobState::kSucceeded && absl::Now() < deadline) {
      Work(absl::Milliseconds(2));  // The farm needs its lock as well.
    }
    EXPECT_EQ(view().state, JobState::kSucceeded);
    EXPECT_GE(view().progress.wall_seconds, view().frames[0].progress.wall_seconds);
    return view().progress.wall_seconds;
  };
  const double before = finish(absl::Milliseconds(300));
  EXPECT_GE(before, 0.3);
  ASSERT_TRUE(farm_->RefineJob(id, {{}, 512}).ok());
  EXPECT_GE(farm_->FindJob(job)->progress.wall_seconds, before);
  const double after = finish(absl::Milliseconds(100));
  EXPECT_GE(after, before + 0.1);
  Start();
  store_->Open();
  EXPECT_NEAR(farm_->FindJob(job)->progress.wall_seconds, after, 1e-6);
  ASSERT_TRUE(farm_->RefineJob(id, {{}, 1024}).ok());
  EXPECT_GE(finish(absl::ZeroDuration()), after);
}

// The time left is told by the cost of the job's samples, and by other jobs' work until then.
TEST_F(FarmTest, RemainingTimeCountsOtherJobs) {
  store_->Open();
  const uint64_t id = MakeJob({});
  const std::string job = absl::StrCat(id);
  const absl::Time deadline = absl::Now() + absl::Seconds(60);
  // One worker with one thread.
  const auto expected = [&](double pixel_samples) {
    return pixel_samples * absl::ToDoubleSeconds(kSampleCpu) / kUsualThreadUse;
  };
  const auto progress = [&] { return farm_->FindJob(job)->progress; };
  while (farm_->FindJob(job)->state != JobState::kSucceeded && absl::Now() < deadline) {
    Work(absl::Milliseconds(2));
  }
  ASSERT_TRUE(farm_->RefineJob(id, {{}, uint64_t{1} << 20}).ok());
  Work();
  const ProgressView alone = progress();
  const auto left = static_cast<double>(alone.sample_count_total - alone.sample_count_done);
  ASSERT_GT(left, 0);
  EXPECT_NEAR(alone.remaining_seconds, expected(left), 0.01 * expected(left));
  EXPECT_NEAR(farm_->FindJob(job)->frames[0].progress.remaining_seconds, alone.remaining_seconds,
              1e-9);
  // Another job that is smaller gets all of its samples meanwhile.
  const uint64_t other = MakeJob({}, uint64_t{1} << 19);
  const double both = expected(left + 16 * 16 * (1 << 19));
  while (progress().remaining_seconds < 0.99 * both && absl::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(10));
  }
  EXPECT_NEAR(progress().remaining_seconds, both, 0.01 * both);
  ASSERT_TRUE(farm_->SetJobPriority(other, -1).ok());
  while (progress().remaining_seconds > 0.99 * both && absl::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(10));
  }
  EXPECT_NEAR(progress().remaining_seconds, alone.remaining_seconds, 1e-9);
}

// A frame without a rule has a point at each doubling that is seen, and one at its end.
TEST_F(FarmTest, FramesWithoutAStopRuleHaveACurve) {
  store_->Open();
  const std::string job = absl::StrCat(MakeJob({}));
  const absl::Time deadline = absl::Now() + absl::Seconds(60);
  const auto rounds = [&] { return farm_->FindJob(job)->frames[0].rounds; };
  Work();
  while (rounds().empty() && absl::Now() < deadline) absl::SleepFor(absl::Milliseconds(10));
  ASSERT_EQ(rounds().size(), 1u);
  EXPECT_EQ(rounds()[0].sample_count, 16u * 256u);
  EXPECT_GT(rounds()[0].relative_mse, 0);
  EXPECT_GT(rounds()[0].relative_mse_upper, rounds()[0].relative_mse);
  EXPECT_GT(rounds()[0].part_bytes, 0u);
  while (!farm_->FindJob(job)->frames[0].complete && absl::Now() < deadline) Work();
  const std::vector<RoundView> curve = rounds();
  ASSERT_GE(curve.size(), 2u);
  EXPECT_LE(curve.size(), 5u);  // 16, 32, 64, 128 and 256 samples.
  EXPECT_EQ(curve.back().sample_count, 256u * 256u);
  const double delivered = farm_->FindJob(job)->frames[0].progress.relative_mse;
  EXPECT_NEAR(curve.back().relative_mse, delivered, 1e-6 * delivered);
  farm_->WaitForEnd(0, absl::Seconds(60));
  EXPECT_EQ(farm_->EndCount(), 1u);
  for (size_t i = 1; i < curve.size(); ++i) {
    EXPECT_GT(curve[i].sample_count, curve[i - 1].sample_count);
    EXPECT_LT(curve[i].relative_mse, curve[i - 1].relative_mse);
  }
}

}  // namespace
}  // namespace sheaf::coordinator
