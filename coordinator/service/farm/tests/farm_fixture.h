// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmTest: a farm for tests, over a store that is slow or refuses changes when a test says so.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>
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
#include "coordinator/service/farm/farm.h"
#include "coordinator/service/farm/tests/gated_job_store.h"
#include "coordinator/store/sql_job_store.h"

namespace sheaf::coordinator {

// Processor time of a pixel sample.
inline constexpr absl::Duration kSampleCpu = absl::Nanoseconds(100);

// Some gray, other than those of the samples before.
inline float GrayOf(uint64_t sample) {
  return static_cast<float>((sample * 0x9E3779B97F4A7C15u) >> 61);
}

// A farm over a gated store, with a job of one tile.
class FarmTest : public ::testing::Test {
 protected:
  FarmTest() {
    directory_ = ::testing::TempDir() + "sheaf-farm-" +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(directory_);
    Start();
  }
  // Also again. keeps_parts: the disk removes no parts.
  void Start(bool keeps_parts = false) {
    auto gated = OpenStore();
    gated->keeps_parts_ = keeps_parts;
    auto farm = Farm::Open(options_, std::move(gated));
    SHEAF_CHECK(farm.ok());
    farm_ = *std::move(farm);
  }
  // The same, but the background thread's work is done by farm_->RunOnce.
  void StartWithoutThread() {
    auto farm = Farm::OpenWithoutThread(options_, OpenStore());
    SHEAF_CHECK(farm.ok());
    farm_ = *std::move(farm);
  }
  std::unique_ptr<GatedJobStore> OpenStore() {
    farm_.reset();
    options_.state_directory = directory_;
    auto sqlite = SqlJobStore::Open(directory_);
    SHEAF_CHECK(sqlite.ok());
    auto gated = std::make_unique<GatedJobStore>(*std::move(sqlite));
    store_ = gated.get();
    return gated;
  }
  ~FarmTest() override {
    store_->Open();
    farm_.reset();
    std::filesystem::remove_all(directory_);
  }
  uint64_t MakeJob(const StopRule& stop, uint64_t samples = 256) {
    JobSpec spec;
    spec.title = "job";
    spec.partition = partition_;
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
    return farm_->intake().Add(result, bytes).status();
  }
  // The value of /metrics; NaN if there is none of that name.
  double Metric(const std::string& name) const {
    for (const MetricView& metric : farm_->view().Metrics()) {
      if (metric.name == name) return metric.value;
    }
    return std::numeric_limits<double>::quiet_NaN();
  }
  // Renders what there is to do, in no less time.
  void Work(absl::Duration time_min = absl::ZeroDuration(),
            absl::StatusCode outcome = absl::StatusCode::kOk) {
    const std::vector<LeaseGrant> grants = Lease("w");
    absl::SleepFor(time_min);
    for (const LeaseGrant& grant : grants) EXPECT_EQ(Deliver(grant).code(), outcome);
  }

  // Measures worker w's speed by another job, which is then finished.
  void LearnSpeed() {
    const uint64_t other = MakeJob({}, 16);
    SHEAF_CHECK(farm_->SetJobPriority(other, {.priority = 1}).ok());
    Work();
  }
  // Renders all that is left of a job, and delivers it. Requires: no background thread.
  void Finish(uint64_t id) {
    const auto succeeded = [&] {
      return farm_->view().FindJob(absl::StrCat(id))->state == JobState::kSucceeded;
    };
    for (int i = 0; i < 1000 && !succeeded(); ++i) {
      Work();
      farm_->RunOnce();
    }
    ASSERT_TRUE(succeeded());
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

  // Loses the bytes of all parts.
  void RemovePartFiles() {
    std::filesystem::remove_all(directory_ + "/parts");
    std::filesystem::create_directory(directory_ + "/parts");
  }
  // Records that an identity made false results.
  void Distrust(const std::string& identity) {
    const MutexLock lock(&farm_->tables().mutex);
    farm_->tables().scheduler.Quarantine(identity, "it lied", /*made_false_results=*/true);
    farm_->tables().NoteEndedJobs();
  }
  uint64_t PartsRevoked() {
    const MutexLock lock(&farm_->tables().mutex);
    return farm_->tables().scheduler.counters().parts_revoked;
  }

  std::string directory_;
  FarmOptions options_;
  Partition partition_ = {16, 16, 1};
  GatedJobStore* store_ = nullptr;
  std::unique_ptr<Farm> farm_;
};

}  // namespace sheaf::coordinator
