// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What the farm promises of durability, held against a store that is slow on purpose.
#include "coordinator/service/farm.h"

#include <condition_variable>
#include <filesystem>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "coordinator/store/sqlite_job_store.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

// Holds every EndJob at the gate until it is opened; all else goes straight through.
class GatedJobStore : public JobStore {
 public:
  explicit GatedJobStore(std::unique_ptr<JobStore> store) : store_(std::move(store)) {}

  void WaitUntilSomeoneEndsAJob() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return waiting_ > 0; });
  }
  void Open() {
    const std::lock_guard lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }

  absl::Status EndJob(uint64_t job_id, JobPhase phase, const std::string& failure,
                      absl::Time end_time) override {
    {
      std::unique_lock lock(mutex_);
      ++waiting_;
      changed_.notify_all();
      changed_.wait(lock, [this] { return open_; });
    }
    return store_->EndJob(job_id, phase, failure, end_time);
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
    return store_->WritePart(row, bytes);
  }
  absl::StatusOr<std::optional<PartRow>> FindPart(const PartKey& key) override {
    return store_->FindPart(key);
  }
  absl::StatusOr<std::vector<PartRow>> FindTileParts(const FrameId& frame,
                                                     const PixelRect& tile) override {
    return store_->FindTileParts(frame, tile);
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
    return store_->AddRound(frame, round);
  }
  absl::StatusOr<std::vector<StoredRound>> LoadRounds(uint64_t job_id, bool with_tiles) override {
    return store_->LoadRounds(job_id, with_tiles);
  }
  absl::Status ReopenJob(uint64_t job_id, const std::vector<ReopenedFrame>& frames) override {
    return store_->ReopenJob(job_id, frames);
  }
  absl::StatusOr<std::optional<FrameId>> OldestDeliveredWithParts() override {
    return store_->OldestDeliveredWithParts();
  }
  uint64_t PartsBytes() const override { return store_->PartsBytes(); }
  uint64_t FirstLeaseId() const override { return store_->FirstLeaseId(); }

 private:
  const std::unique_ptr<JobStore> store_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int waiting_ = 0;
  bool open_ = false;
};

// Whoever cancels a job that somebody else is writing down as cancelled has no answer before that
// is durable: after a power cut the job would be alive again, against what was said.
TEST(FarmTest, ASecondCancelWaitsUntilTheFirstIsDurable) {
  FarmOptions options;
  options.state_directory = testing::TempDir() + "sheaf-farm-cancel";
  std::filesystem::remove_all(options.state_directory);
  auto sqlite = SqliteJobStore::Open(options.state_directory);
  ASSERT_TRUE(sqlite.ok()) << sqlite.status();
  auto gated = std::make_unique<GatedJobStore>(*std::move(sqlite));
  GatedJobStore& store = *gated;
  auto farm = Farm::Open(options, std::move(gated));
  ASSERT_TRUE(farm.ok()) << farm.status();
  JobSpec spec;
  spec.title = "job";
  spec.partition = {16, 4, 1};
  FrameSpec frame;
  frame.frame_number = 1;
  const auto scene = (*farm)->blobs().Put("a scene");
  ASSERT_TRUE(scene.ok());
  frame.scene = *scene;
  frame.settings.width_px = frame.settings.height_px = 16;
  frame.settings.window = {0, 0, 16, 16};
  spec.frames = {frame};
  const auto job = (*farm)->CreateJob(spec, "request");
  ASSERT_TRUE(job.ok()) << job.status();

  const auto cancel = [&] { return (*farm)->CancelJob(*job); };
  std::future<absl::Status> first = std::async(std::launch::async, cancel);
  store.WaitUntilSomeoneEndsAJob();
  std::future<absl::Status> second = std::async(std::launch::async, cancel);
  EXPECT_EQ(second.wait_for(std::chrono::milliseconds(200)), std::future_status::timeout);
  store.Open();
  EXPECT_TRUE(first.get().ok());
  EXPECT_TRUE(second.get().ok());
  std::filesystem::remove_all(options.state_directory);
}

}  // namespace
}  // namespace sheaf::coordinator
