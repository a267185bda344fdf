// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the farm's durability with a store that is slow on purpose.
#include "coordinator/service/farm/farm.h"

#include <atomic>
#include <filesystem>
#include <future>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/check.h"
#include "common/base/digest.h"
#include "common/base/mutex.h"
#include "common/film/exr/exr_codec.h"
#include "coordinator/store/sqlite_job_store.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

// Holds every EndJob and AddRound at the gate until it is opened; all else goes straight through.
class GatedJobStore : public JobStore {
 public:
  explicit GatedJobStore(std::unique_ptr<JobStore> store) : store_(std::move(store)) {}

  void WaitUntilSomeoneIsThere() {
    const MutexLock lock(&mutex_);
    changed_.Wait(&mutex_, [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return waiting_ > 0; });
  }
  void Open() {
    const MutexLock lock(&mutex_);
    open_ = true;
    changed_.NotifyAll();
  }

  absl::Status EndJob(uint64_t job_id, JobPhase phase, const std::string& failure,
                      absl::Time end_time, absl::Duration wall) override {
    PassTheGate();
    return store_->EndJob(job_id, phase, failure, end_time, wall);
  }
  absl::Status WriteFailures(uint64_t job_id, const FailureLog& failures) override {
    return store_->WriteFailures(job_id, failures);
  }
  absl::Status WriteQuarantine(const QuarantineRecord& record) override {
    return store_->WriteQuarantine(record);
  }
  absl::Status RemoveQuarantine(const std::string& identity) override {
    return store_->RemoveQuarantine(identity);
  }
  absl::StatusOr<std::vector<QuarantineRecord>> LoadQuarantines() override {
    return store_->LoadQuarantines();
  }
  absl::Status SetWarning(uint64_t job_id, const std::string& warning) override {
    return store_->SetWarning(job_id, warning);
  }
  absl::StatusOr<std::vector<PartRow>> FindPartsOf(const std::string& identity) override {
    return store_->FindPartsOf(identity);
  }
  absl::Status SetPaused(uint64_t job_id, bool paused) override {
    ++control_writes_;
    return full_ ? Full() : store_->SetPaused(job_id, paused);
  }
  absl::Status SetPriority(uint64_t job_id, int32_t priority) override {
    ++control_writes_;
    return full_ ? Full() : store_->SetPriority(job_id, priority);
  }
  absl::StatusOr<std::vector<StoredJob>> LoadJobs() override { return store_->LoadJobs(); }
  absl::StatusOr<LoadedParts> LoadParts(uint64_t job_id) override {
    return store_->LoadParts(job_id);
  }
  absl::StatusOr<CreatedJob> CreateJob(const JobSpec& spec, const std::string& request_id,
                                       absl::Time create_time) override {
    return store_->CreateJob(spec, request_id, create_time);
  }
  absl::StatusOr<std::optional<uint64_t>> FindRequest(const std::string& request_id) override {
    return store_->FindRequest(request_id);
  }
  absl::Status WritePart(const PartRow& row, const std::string& bytes) override {
    return full_ ? Full() : store_->WritePart(row, bytes);
  }
  absl::Status Probe() override { return full_ ? Full() : store_->Probe(); }
  absl::StatusOr<std::optional<PartRow>> FindPart(const PartKey& key) override {
    return store_->FindPart(key);
  }
  absl::StatusOr<std::vector<PartRow>> FindTileParts(const FrameId& frame,
                                                     const PixelRect& tile) override {
    return store_->FindTileParts(frame, tile);
  }
  absl::StatusOr<std::vector<RoundRecord>> LoadFrameRounds(const FrameId& frame) override {
    return store_->LoadFrameRounds(frame);
  }
  absl::StatusOr<std::vector<TileCost>> TileCosts(const FrameId& frame) override {
    return store_->TileCosts(frame);
  }
  absl::StatusOr<std::string> ReadPart(const PartRow& row) override {
    return store_->ReadPart(row);
  }
  absl::Status RemovePart(const PartRow& row) override { return store_->RemovePart(row); }
  absl::Status RemoveFrameParts(const FrameId& frame) override {
    return store_->RemoveFrameParts(frame);
  }
  absl::StatusOr<std::string> OutputPath(const FrameId& frame) override {
    return store_->OutputPath(frame);
  }
  absl::Status DeliverFrame(const FrameId& frame, const DeliveredFrame& delivered) override {
    return store_->DeliverFrame(frame, delivered);
  }
  absl::Status AddRound(const FrameId& frame, const RoundRecord& round) override {
    PassTheGate();
    return store_->AddRound(frame, round);
  }
  absl::StatusOr<std::vector<StoredRound>> LoadRounds(uint64_t job_id, bool with_cells) override {
    return store_->LoadRounds(job_id, with_cells);
  }
  absl::Status ReopenJob(uint64_t job_id, const std::vector<ReopenedFrame>& frames) override {
    return store_->ReopenJob(job_id, frames);
  }
  absl::StatusOr<std::optional<FrameId>> OldestDeliveredWithParts() override {
    return store_->OldestDeliveredWithParts();
  }
  uint64_t PartsBytes() const override { return store_->PartsBytes(); }
  uint64_t FirstLeaseId() const override { return store_->FirstLeaseId(); }

  std::atomic<bool> full_ = false;       // Whether the disk takes no parts, pauses and priorities.
  std::atomic<int> control_writes_ = 0;  // Pauses and priorities, also those that failed.

 private:
  static absl::Status Full() { return absl::ResourceExhaustedError("writing x: no space left"); }
  void PassTheGate() {
    const MutexLock lock(&mutex_);
    ++waiting_;
    changed_.NotifyAll();
    changed_.Wait(&mutex_, [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return open_; });
  }

  const std::unique_ptr<JobStore> store_;
  Mutex mutex_;
  CondVar changed_;
  int waiting_ ABSL_GUARDED_BY(mutex_) = 0;
  bool open_ ABSL_GUARDED_BY(mutex_) = false;
};

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
  // Renders what there is to do, in gray that varies from sample to sample, in no less time.
  void Work(absl::Duration time_min = absl::ZeroDuration(),
            absl::StatusCode outcome = absl::StatusCode::kOk) {
    WorkerReport report;
    report.worker_id = report.host = "w";
    report.numeric_profile = NumericProfile();
    report.requested_lease_count = 1;
    const auto answer = farm_->Synchronize(report);
    ASSERT_TRUE(answer.ok()) << answer.status();
    absl::SleepFor(time_min);
    for (const LeaseGrant& grant : answer->leases) {
      const SampleBlock block = grant.lease.task.block;
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
      const std::string bytes =
          EncodePart(tile, {grant.frame_digest, report.numeric_profile, {}, grant.lease.cells});
      ResultReport result;
      result.frame_digest = grant.frame_digest;
      result.tile = grant.lease.tile_rect;
      result.block = block;
      result.cells = grant.lease.cells;
      result.lease_id = grant.lease.lease_id;
      result.token = grant.token;
      result.worker_id = report.worker_id;
      result.cpu_duration = kSampleCpu * static_cast<double>(grant.lease.tile_rect.PixelCount()) *
                            static_cast<double>(block.count);
      result.digest = {Sha256Hex(bytes), bytes.size()};
      EXPECT_EQ(farm_->AddResult(result, bytes).status().code(), outcome);
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
