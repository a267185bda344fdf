// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds a sequence of messages as workers send them to a scheduler with one job: reports of
// themselves and headers of results, with time passing between them. Whatever they say, the samples
// of the job are accepted once, and no worker holds more leases than the limit.
#include <map>
#include <set>
#include <string>
#include <tuple>

#include "common/base/digest.h"
#include "common/base/steady_time.h"
#include "coordinator/scheduling/scheduler.h"
#include "coordinator/service/grpc/wire.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/small_farm.h"

namespace sheaf::coordinator {
namespace {

using Found = Scheduler::FoundTask::Kind;

// One frame of 2 x 2 tiles and four passes. Its frame digest is that of corpus files.
JobSpec SmallJob() {
  FrameSpec frame;
  frame.frame_number = 1;
  frame.scene = {std::string(64, 'a'), 1};
  frame.settings.width_px = frame.settings.height_px = 64;
  frame.settings.window = {0, 0, 64, 64};
  frame.settings.samples = 64;
  JobSpec spec;
  spec.frames = {frame};
  testing::CompleteSpec(1, &spec);
  spec.frames[0].frame_digest = std::string(64, 'b');
  return spec;
}

class WorkersAndJob {
 public:
  WorkersAndJob() : scheduler_(testing::SmallLimits(), 1) { scheduler_.AddJob(SmallJob()); }

  void Take(uint8_t kind, std::string_view bytes) {
    now_ += absl::Milliseconds(1);
    if (kind % 4 == 0) return Synchronize(bytes);
    if (kind % 4 == 1) return AddResult(bytes);
    now_ += absl::Seconds(kind / 4);
    scheduler_.Tick(now_);
  }

  // All of what was accepted, once.
  void Check() const {
    const JobRecord& job = scheduler_.jobs().at(1);
    const FrameRecord& frame = job.frames[0];
    SHEAF_CHECK(frame.sample_count_done == accepted_);
    SHEAF_CHECK(accepted_ <= SampleCountTotal(frame));
  }

 private:
  void Synchronize(std::string_view bytes) {
    v1::SynchronizeRequest request;
    if (!request.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
    const absl::StatusOr<WorkerReport> report = FromWire(request);
    if (!report.ok()) return;
    const absl::StatusOr<Scheduler::SynchronizeAnswer> answer =
        scheduler_.Synchronize(*report, now_);
    if (!answer.ok()) return;
    SHEAF_CHECK(answer->leases.size() <=
                static_cast<size_t>(testing::SmallLimits().leases_per_worker_max));
    for (const Lease& lease : answer->leases) SHEAF_CHECK(lease.worker_id == report->worker_id);
    ToWire(testing::AnswerOf(scheduler_, *answer));
    scheduler_.TakeEndedJobs();
    scheduler_.TakeFailureJobs(absl::UnixEpoch());
  }

  void AddResult(std::string_view bytes) {
    v1::ResultHeader header;
    if (!header.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
    const absl::StatusOr<ResultReport> report = FromWire(header);
    if (!report.ok()) return;
    const Scheduler::FoundTask found = scheduler_.FindTask(
        report->frame_digest, report->tile, report->block, report->cells, report->lease_id,
        report->kind);
    if (found.kind != Found::kWanted) return;
    accepted_ += static_cast<uint64_t>(report->tile.PixelCount()) * report->block.count;
    scheduler_.Accept(found.frame, found.task, report->lease_id, report->worker_id,
                      {report->ray_count, 0, report->cpu_duration, report->digest.size_bytes},
                      now_);
  }

  Scheduler scheduler_;
  SteadyTime now_ = SteadyTime() + absl::Seconds(1);
  uint64_t accepted_ = 0;  // Pixel samples.
};

}  // namespace

// A sequence of: kind (1 byte), length (2 bytes, little-endian), message.
SHEAF_FUZZ_TARGET(worker_messages) {
  WorkersAndJob farm;
  while (!bytes.empty()) {
    const uint8_t kind = testing::TakeByte(&bytes);
    size_t length = testing::TakeByte(&bytes);
    length |= size_t{testing::TakeByte(&bytes)} << 8;
    farm.Take(kind, bytes.substr(0, length));
    bytes.remove_prefix(std::min(length, bytes.size()));
  }
  farm.Check();
}

}  // namespace sheaf::coordinator
