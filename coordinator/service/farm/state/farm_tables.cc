// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/state/farm_tables.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"

namespace sheaf::coordinator {
namespace {

// The fewest samples of a cell; 0 if cells are not known.
uint64_t FewestSamples(const RoundRecord& record) {
  uint64_t fewest = std::numeric_limits<uint64_t>::max();
  for (const CellRound& cell : record.cells) fewest = std::min(fewest, cell.samples);
  return record.cells.empty() ? 0 : fewest;
}

}  // namespace

uint64_t NextPoint(const RoundRecord& last) {
  return 2 * std::bit_floor(std::max(FewestSamples(last), kReplicateCount / uint64_t{2}));
}

absl::StatusOr<const JobRecord*> FarmTables::FindJob(uint64_t job_id) const {
  const auto found = scheduler.jobs().find(job_id);
  if (found != scheduler.jobs().end()) return &found->second;
  return absl::NotFoundError(absl::StrCat("jobs/", job_id, ": there is no such job"));
}

void FarmTables::NoteEndedJobs() {
  const absl::Time now = absl::Now();
  unsaved_failures.merge(scheduler.TakeFailureJobs(now));
  for (auto& [id, trouble] : scheduler.TakeTroubles()) unsaved_troubles[id] = std::move(trouble);
  for (const FrameId& id : scheduler.TakeIncompleteFrames()) {
    const FrameRecord* frame = scheduler.FindFrame(id);
    const bool goes_on = frame != nullptr && frame->tasks != nullptr;
    if (!goes_on) open_frames.erase(id);
  }
  for (QuarantineRecord& record : scheduler.TakeQuarantines(now)) {
    if (record.made_false_results) liars.push_back(record.identity);
    unsaved_quarantines.push_back(std::move(record));
  }
  for (const uint64_t id : scheduler.TakeEndedJobs()) {
    JobAccount& account = accounts.at(id);
    account.end_time = now;
    account.ended = SteadyTime::Now();
    pilots_asked.erase(id);
    unsettled_jobs.push_back(id);
  }
}

std::shared_ptr<OpenFrame> FarmTables::Open(const FrameId& id, const std::set<uint32_t>& on_disk) {
  std::shared_ptr<OpenFrame>& open = open_frames[id].frame;
  if (open == nullptr) {
    const FrameRecord& record = *scheduler.FindFrame(id);
    const FrameTasks& tasks = *record.tasks;
    open = std::make_shared<OpenFrame>(record.Spec(), tasks.grid(), tasks.SamplesOfCells(),
                                       FirstPointOf(id), &merge_budget, on_disk);
  }
  return open;
}

const FrameRecord* FarmTables::ToOpen(const FrameId& id) const {
  const FrameRecord* record = scheduler.FindFrame(id);
  const bool is_open = open_frames.contains(id);
  return is_open || record == nullptr || record->tasks == nullptr ? nullptr : record;
}

void FarmTables::PrepareOpen(const FrameId& id) {
  const MutexLock preparing(&prepare_mutex);
  FrameSpec spec;
  Partition partition;
  std::vector<uint64_t> samples;
  uint64_t first_point_samples = 0;
  {
    const MutexLock lock(&mutex);
    const FrameRecord* record = ToOpen(id);
    if (record == nullptr) return;
    spec = record->Spec();
    partition = scheduler.jobs().at(id.job_id).spec.partition;
    samples = record->tasks->SamplesOfCells();
    first_point_samples = FirstPointOf(id);
  }
  CellGrid grid(spec, partition);  // As in the frame's tasks.
  auto open = std::make_shared<OpenFrame>(std::move(spec), std::move(grid), std::move(samples),
                                          first_point_samples, &merge_budget);
  const MutexLock lock(&mutex);
  if (ToOpen(id) != nullptr) open_frames[id].frame = std::move(open);
}

uint64_t FarmTables::FirstPointOf(const FrameId& id) const {
  const RoundRecord* last = LastRoundOf(id);
  return last == nullptr ? kReplicateCount : NextPoint(*last);
}

const RoundRecord* FarmTables::LastRoundOf(const FrameId& id) const {
  const JobAccount& account = accounts.at(id.job_id);
  const auto rounds = account.rounds.find(id.frame_number);
  return rounds == account.rounds.end() ? nullptr : &rounds->second.back();
}

const std::vector<RoundRecord>& FarmTables::AddRound(const FrameId& id, RoundRecord record) {
  std::vector<RoundRecord>& rounds = accounts[id.job_id].rounds[id.frame_number];
  if (!rounds.empty()) rounds.back().cells.clear();  // Only the last round's are needed later.
  rounds.push_back(std::move(record));
  return rounds;
}

absl::Duration FarmTables::WallSince(uint64_t job_id, SteadyTime first_lease_time,
                                     SteadyTime now) const {
  const SteadyTime until =
      std::min({now, accounts.at(job_id).ended, scheduler.jobs().at(job_id).paused_time});
  return first_lease_time < until ? until - first_lease_time : absl::ZeroDuration();
}

absl::Duration FarmTables::WallOf(const FrameId& id, SteadyTime now) const {
  const JobAccount& account = accounts.at(id.job_id);
  const auto before = account.wall_before.find(id.frame_number);
  return (before == account.wall_before.end() ? absl::ZeroDuration() : before->second) +
         WallSince(id.job_id, scheduler.FindFrame(id)->first_lease_time, now);
}

absl::Duration FarmTables::WallOfJob(const JobRecord& job, SteadyTime now) const {
  const uint64_t id = job.spec.job_id;
  return accounts.at(id).job_wall_before + WallSince(id, FirstLeaseTime(job), now);
}

uint64_t FarmTables::SamplesExpected(const FrameId& id, const FrameRecord& frame) const {
  const uint64_t total = SampleCountTotal(frame);
  if (frame.phase == FrameRecord::Phase::kDelivered) return total;
  const RoundRecord* last = LastRoundOf(id);
  return last == nullptr ? total : std::max(total, last->sample_count_expected);
}

const FarmLoad& FarmTables::LoadOf(const std::string& numeric_profile, SteadyTime now) {
  constexpr absl::Duration kKept = absl::Milliseconds(500);
  if (now - loads_time > kKept) loads.clear();
  if (loads.empty()) loads_time = now;
  const auto [entry, missing] = loads.try_emplace(numeric_profile);
  FarmLoad& load = entry->second;
  if (!missing) return load;
  for (const auto& [id, worker] : scheduler.workers().workers()) {
    if (worker.Live() && worker.numeric_profile == numeric_profile) {
      load.threads_used += worker.ThreadsUsed();
    }
  }
  std::vector<WorkLeft> jobs;
  std::vector<SharedJob> shared;
  for (const auto& [id, job] : scheduler.jobs()) {
    if (job.phase != JobPhase::kLive || !job.MayLease() ||
        job.spec.numeric_profile != numeric_profile) {
      continue;
    }
    uint64_t left = 0, done = 0;
    for (const FrameRecord& frame : job.frames) {
      if (frame.phase == FrameRecord::Phase::kIncomplete) continue;
      const uint64_t expected = SamplesExpected({id, frame.number()}, frame);
      left += expected - std::min(expected, frame.sample_count_done);
      done += frame.sample_count_done;
    }
    jobs.push_back(WorkLeftOf(job, left));
    const double all = std::max(1.0, static_cast<double>(left) + static_cast<double>(done));
    shared.push_back({id, jobs.back(), static_cast<double>(done) / all, job.spec.show,
                      job.spec.owner, scheduler.WeightOf({ShareKind::kShow, job.spec.show}),
                      scheduler.WeightOf({ShareKind::kUser, job.spec.owner})});
  }
  load.ahead = WorkAhead(std::move(jobs));
  load.shared = SharedFarm(std::move(shared), load.threads_used, ShareByTime);
  return load;
}

}  // namespace sheaf::coordinator
