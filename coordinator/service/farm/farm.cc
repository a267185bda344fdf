// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/farm.h"

#include <algorithm>
#include <optional>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/log.h"
#include "coordinator/core/job_check.h"
#include "coordinator/store/sqlite_job_store.h"

namespace sheaf::coordinator {

absl::StatusOr<std::unique_ptr<Farm>> Farm::Open(const FarmOptions& options) {
  absl::StatusOr<std::unique_ptr<SqliteJobStore>> store =
      SqliteJobStore::Open(options.state_directory, options.durability);
  if (!store.ok()) return store.status();
  return Open(options, *std::move(store));
}

absl::StatusOr<std::unique_ptr<Farm>> Farm::Open(const FarmOptions& options,
                                                 std::unique_ptr<JobStore> store) {
  absl::StatusOr<std::unique_ptr<BlobStore>> blobs =
      BlobStore::Open(options.state_directory + "/content");
  if (!blobs.ok()) return blobs.status();
  absl::StatusOr<std::unique_ptr<RoundPreviews>> round_previews = RoundPreviews::Open(
      options.state_directory + "/rounds", {.bytes_max = options.round_previews_bytes_max});
  if (!round_previews.ok()) return round_previews.status();
  std::unique_ptr<Farm> farm(
      new Farm(options, std::move(store), *std::move(blobs), *std::move(round_previews)));
  if (absl::Status status = farm->Load(); !status.ok()) return status;
  farm->background_ = std::thread([f = farm.get()] { f->RunBackground(); });
  return farm;
}

Farm::Farm(const FarmOptions& options, std::unique_ptr<JobStore> store,
           std::unique_ptr<BlobStore> blobs, std::unique_ptr<RoundPreviews> round_previews)
    : options_(options),
      store_(std::move(store)),
      blobs_(std::move(blobs)),
      round_previews_(std::move(round_previews)),
      numeric_profile_(NumericProfile()),
      merge_budget_(options.merge_bytes_max),
      scene_names_(blobs_.get()),
      scheduler_(options.limits, store_->FirstLeaseId()) {}

Farm::~Farm() {
  {
    const MutexLock lock(&background_mutex_);
    stopping_ = true;
  }
  background_wake_.NotifyAll();
  if (background_.joinable()) background_.join();
  const MutexLock settling(&settle_mutex_);
  SaveFailures();
}

namespace {

std::vector<FrameSpec> UndeliveredOf(const StoredJob& job) {
  std::set<int32_t> delivered;
  for (const StoredFrame& frame : job.delivered) delivered.insert(frame.frame_number);
  std::vector<FrameSpec> frames;
  for (const FrameSpec& frame : job.spec.frames) {
    if (!delivered.contains(frame.frame_number)) frames.push_back(frame);
  }
  return frames;
}

}  // namespace

absl::Status Farm::Load() {
  const absl::StatusOr<std::vector<StoredJob>> jobs = store_->LoadJobs();
  if (!jobs.ok()) return jobs.status();
  const MutexLock lock(&mutex_);
  for (const StoredJob& job : *jobs) {
    std::optional<JobStore::LoadedParts> parts;
    absl::StatusOr<ResumedCounts> resumed = ResumedCounts();
    if (job.phase == JobPhase::kLive) {
      if (absl::Status fits = CheckJobSpec(job.spec, options_.limits); !fits.ok()) {
        resumed = std::move(fits);
      } else {
        resumed = CountResumed(UndeliveredOf(job), job.spec.partition);
      }
      absl::StatusOr<JobStore::LoadedParts> loaded = store_->LoadParts(job.spec.job_id);
      if (!loaded.ok()) return loaded.status();
      parts = *std::move(loaded);
    }
    JobAccount& account = accounts_[job.spec.job_id];
    account.create_time = job.create_time;
    account.end_time = job.end_time;
    absl::Status status = RestoreJob(job, parts && resumed.ok() ? &*parts : nullptr,
                                     resumed.ok() ? *resumed : ResumedCounts());
    if (!status.ok()) return status;
    if (resumed.ok()) continue;
    scheduler_.EndJob(job.spec.job_id, JobPhase::kFailed, std::string(resumed.status().message()));
    NoteEndedJobs();
  }
  return absl::OkStatus();
}

absl::Status Farm::RestoreJob(const StoredJob& job, const JobStore::LoadedParts* parts,
                              const ResumedCounts& resumed) {
  scheduler_.AddJob(job.spec);
  scheduler_.RestoreFailures(job.spec.job_id, job.failures);
  JobAccount& account = accounts_[job.spec.job_id];
  account.job_wall_before = std::max(account.job_wall_before, job.wall_duration);
  for (const StoredFrame& frame : job.delivered) {
    account.job_wall_before = std::max(account.job_wall_before, frame.delivered.wall_duration);
    account.delivered[frame.frame_number] = frame.delivered;
    scheduler_.RestoreDelivered({job.spec.job_id, frame.frame_number}, frame.delivered.cost,
                                frame.delivered.sample_count);
  }
  RestoreResumed(job.spec.job_id, resumed);
  if (absl::Status status = LoadRounds(job); !status.ok()) return status;
  if (job.phase == JobPhase::kLive) {
    if (IsPilot(job.spec.job_id)) {
      pilots_asked_[job.spec.job_id] = std::chrono::steady_clock::now();
    }
    if (parts == nullptr) return absl::OkStatus();  // It cannot go on.
    TilesOnDisk on_disk = RestoreResumedParts(job.spec.job_id, resumed);
    if (job.paused) scheduler_.Pause(job.spec.job_id, SteadyTime::Now());
    return RestoreLiveJob(job, *parts, std::move(on_disk));
  }
  scheduler_.RestoreEnded(job.spec.job_id, job.phase, job.failure);
  return absl::OkStatus();
}

absl::Status Farm::RestoreLiveJob(const StoredJob& job, const JobStore::LoadedParts& parts,
                                  TilesOnDisk on_disk) {
  scheduler_.counters().parts_revoked += static_cast<uint64_t>(parts.rows_lost);
  if (parts.rows_lost > 0) {
    LogWarning(absl::StrCat("job ", job.spec.job_id, ": ", parts.rows_lost,
                            " parts are missing on disk and will be rendered again"));
  }
  for (const PartRow& row : parts.rows) {
    const FrameRecord* frame = scheduler_.FindFrame(row.key.frame);
    const bool wanted = frame != nullptr && frame->phase != FrameRecord::Phase::kDelivered;
    if (!wanted) continue;  // Delivered, and stopped before its parts were removed.
    const FrameTasks::Fit fit =
        scheduler_.RestorePart(row.key.frame, row.key.tile, row.key.block, row.key.cells, row.cost);
    if (fit == FrameTasks::Fit::kOutside) {
      // A refined frame goes on from a round before this part's.
      if (absl::Status status = store_->RemovePart(row); !status.ok()) return status;
      continue;
    }
    if (fit != FrameTasks::Fit::kWanted) {
      return absl::DataLossError(
          absl::StrCat(options_.state_directory, "/farm.db: overlapping parts of frame ",
                       row.key.frame.frame_number, " of job ", row.key.frame.job_id));
    }
    on_disk[row.key.frame].insert(*frame->tasks->grid().FindTile(row.key.tile));
  }
  for (const auto& [id, tiles] : on_disk) OpenFrameOf(id, tiles);
  for (const FrameSpec& spec : job.spec.frames) {
    const FrameId id{job.spec.job_id, spec.frame_number};
    if (scheduler_.FindFrame(id)->phase == FrameRecord::Phase::kRendered) to_deliver_.push_back(id);
  }
  if (!parts.rows.empty()) {
    LogInfo(absl::StrCat("job ", job.spec.job_id, ": resumed with ", parts.rows.size(),
                         " results on disk"));
  }
  // All frames were delivered, but the coordinator was stopped before it noted the job's end.
  if (job.delivered.size() == job.spec.frames.size()) {
    scheduler_.EndJob(job.spec.job_id, JobPhase::kSucceeded, "");
    NoteEndedJobs();
  }
  return absl::OkStatus();
}

// Requires: the frame has tasks.
std::shared_ptr<OpenFrame> Farm::OpenFrameOf(const FrameId& id, const std::set<uint32_t>& on_disk) {
  std::shared_ptr<OpenFrame>& open = open_frames_[id].frame;
  if (open == nullptr) {
    const FrameRecord& record = *scheduler_.FindFrame(id);
    const FrameTasks& tasks = *record.tasks;
    open = std::make_shared<OpenFrame>(record.Spec(), tasks.grid(), tasks.SamplesOfCells(),
                                       FirstPointOf(id), &merge_budget_, on_disk);
  }
  return open;
}

const FrameRecord* Farm::ToOpen(const FrameId& id) const {
  const FrameRecord* record = scheduler_.FindFrame(id);
  const bool is_open = open_frames_.contains(id);
  return is_open || record == nullptr || record->tasks == nullptr ? nullptr : record;
}

void Farm::PrepareOpenFrame(const FrameId& id) {
  const MutexLock preparing(&prepare_mutex_);
  FrameSpec spec;
  std::optional<CellGrid> grid;
  std::vector<uint64_t> samples;
  uint64_t first_point_samples = 0;
  {
    const MutexLock lock(&mutex_);
    const FrameRecord* record = ToOpen(id);
    if (record == nullptr) return;
    spec = record->Spec();
    grid = record->tasks->grid();
    samples = record->tasks->SamplesOfCells();
    first_point_samples = FirstPointOf(id);
  }
  auto open = std::make_shared<OpenFrame>(std::move(spec), *std::move(grid), std::move(samples),
                                          first_point_samples, &merge_budget_);
  const MutexLock lock(&mutex_);
  if (ToOpen(id) != nullptr) open_frames_[id].frame = std::move(open);
}

void Farm::Changed() const {
  {
    const MutexLock lock(&change_mutex_);
    ++change_count_;
  }
  change_.NotifyAll();
}

uint64_t Farm::ChangeCount() const {
  const MutexLock lock(&change_mutex_);
  return change_count_;
}

uint64_t Farm::WaitForChange(uint64_t seen, absl::Duration timeout) const {
  const MutexLock lock(&change_mutex_);
  const auto changed = [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(change_mutex_) {
    return change_count_ != seen;
  };
  change_.WaitFor(&change_mutex_, timeout, changed);
  return change_count_;
}

uint64_t Farm::EndCount() const {
  const MutexLock lock(&change_mutex_);
  return end_count_;
}

void Farm::WaitForEnd(uint64_t seen, absl::Duration timeout) const {
  const MutexLock lock(&change_mutex_);
  const auto ended = [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(change_mutex_) {
    return end_count_ != seen;
  };
  end_.WaitFor(&change_mutex_, timeout, ended);
}

void Farm::NoteDisk(const absl::Status& status) {
  const bool of_disk = absl::IsResourceExhausted(status) || absl::IsUnavailable(status) ||
                       absl::IsPermissionDenied(status) || absl::IsDataLoss(status);
  if (!status.ok() && !of_disk) return;
  const MutexLock lock(&mutex_);
  const bool changed = status.ok() != disk_status_.ok();
  disk_status_ = status;
  if (!changed) return;
  if (status.ok()) {
    LogInfo("the state directory is writable again");
  } else {
    LogError(absl::StrCat(WhyWritesWait(), "; results are not acknowledged until it is"));
  }
  Changed();  // What jobs wait for.
}

std::string Farm::WhyWritesWait() const {
  return absl::StrCat("the coordinator's state directory is not writable: ",
                      disk_status_.message());
}

absl::StatusOr<uint64_t> Farm::CreateJob(JobSpec spec, const std::string& request_id) {
  const absl::StatusOr<std::optional<uint64_t>> existing = store_->FindRequest(request_id);
  if (!existing.ok()) return existing.status();
  if (existing->has_value()) return **existing;
  spec.numeric_profile = numeric_profile_;
  std::sort(spec.frames.begin(), spec.frames.end(),
            [](const FrameSpec& a, const FrameSpec& b) { return a.frame_number < b.frame_number; });
  for (FrameSpec& frame : spec.frames) {
    frame.frame_digest = FrameDigest(frame.scene.sha256_hex, frame.settings, numeric_profile_);
  }
  {
    const MutexLock lock(&mutex_);
    if (absl::Status status = scheduler_.CheckJob(spec); !status.ok()) return status;
  }
  if (spec.partition.cell_size_px == 0) {
    // Also of frames that have no rule yet: they may be refined by one.
    for (const FrameSpec& frame : spec.frames) {
      const int32_t size = ChooseCellSize(frame.settings.window, spec.partition.tile_size_px);
      spec.partition.cell_size_px = std::max(spec.partition.cell_size_px, size);
    }
  }
  StoredJob job;
  job.spec = std::move(spec);
  const absl::StatusOr<ResumedCounts> resumed = CountResumed(job.spec.frames, job.spec.partition);
  if (!resumed.ok()) return resumed.status();
  const absl::Time now = absl::Now();
  const absl::StatusOr<JobStore::CreatedJob> created = store_->CreateJob(job.spec, request_id, now);
  NoteDisk(created.status());
  if (!created.ok()) return created.status();
  if (created->is_new) {
    const MutexLock lock(&mutex_);
    job.spec.job_id = created->job_id;
    accounts_[job.spec.job_id].create_time = now;
    const JobStore::LoadedParts none;
    if (absl::Status s = RestoreJob(job, &none, *resumed); !s.ok()) return s;
    const size_t frame_count = job.spec.frames.size();
    LogInfo(absl::StrCat("job ", job.spec.job_id, ": \"", job.spec.title, "\", ", frame_count,
                         frame_count == 1 ? " frame" : " frames"));
  }
  Changed();
  return created->job_id;
}

// Dates jobs that the scheduler has just ended, and failures. Under the lock that ended them, so
// that nobody sees an ended job without its time.
void Farm::NoteEndedJobs() {
  const absl::Time now = absl::Now();
  unsaved_failures_.merge(scheduler_.TakeFailureJobs(now));
  for (const uint64_t id : scheduler_.TakeEndedJobs()) {
    JobAccount& account = accounts_.at(id);
    account.end_time = now;
    account.ended = SteadyTime::Now();
    pilots_asked_.erase(id);
    unsettled_jobs_.push_back(id);
  }
}

// Writes down the end of jobs that have ended, and lets go of their parts. What the disk refuses is
// tried again by the background thread.
void Farm::SettleEndedJobs() {
  struct Ended {
    uint64_t job_id;
    JobPhase phase;
    std::string failure;
    std::vector<FrameId> frames;
    absl::Time time;
    absl::Duration wall;
  };
  const MutexLock settling(&settle_mutex_);
  SaveFailures();  // Who sees that a job has failed finds out why.
  std::vector<Ended> ended;
  {
    const MutexLock lock(&mutex_);
    for (const uint64_t id : std::exchange(unsettled_jobs_, {})) {
      const JobRecord& job = scheduler_.jobs().at(id);
      const absl::Time end_time = accounts_.at(id).end_time;
      Ended entry{id, job.phase, job.failure, {}, end_time, WallOfJob(job, accounts_.at(id).ended)};
      for (auto it = open_frames_.lower_bound({id, INT32_MIN});
           it != open_frames_.end() && it->first.job_id == id; ++it) {
        entry.frames.push_back(it->first);
      }
      ended.push_back(std::move(entry));
    }
  }
  for (const Ended& job : ended) {
    absl::Status status = store_->EndJob(job.job_id, job.phase, job.failure, job.time, job.wall);
    NoteDisk(status);
    if (!status.ok()) {
      const MutexLock lock(&mutex_);
      unsettled_jobs_.push_back(job.job_id);
      continue;
    }
    if (job.phase == JobPhase::kFailed) {
      LogWarning(absl::StrCat("job ", job.job_id, " failed: ", job.failure));
    } else {
      LogInfo(absl::StrCat("job ", job.job_id,
                           job.phase == JobPhase::kSucceeded ? " succeeded" : " was cancelled"));
    }
    for (const FrameId& frame : job.frames) {
      NoteDisk(store_->RemoveFrameParts(frame));
      round_previews_->RemoveFrom(frame, 0);
    }
    EraseOpenFrames(job.job_id);
  }
  if (ended.empty()) return;
  Changed();
  {
    const MutexLock lock(&change_mutex_);
    end_count_ += ended.size();
  }
  end_.NotifyAll();
}

// Writes down failures that are new. What the disk refuses is tried again.
void Farm::SaveFailures() {
  std::map<uint64_t, FailureLog> logs;
  {
    const MutexLock lock(&mutex_);
    for (const uint64_t id : std::exchange(unsaved_failures_, {})) {
      const auto job = scheduler_.jobs().find(id);
      if (job != scheduler_.jobs().end()) logs[id] = job->second.failures;
    }
  }
  for (const auto& [id, log] : logs) {
    const absl::Status status = store_->WriteFailures(id, log);
    NoteDisk(status);
    if (status.ok()) continue;
    const MutexLock lock(&mutex_);
    unsaved_failures_.insert(id);
  }
}

void Farm::EraseOpenFrames(uint64_t job_id) {
  const MutexLock lock(&mutex_);
  open_frames_.erase(open_frames_.lower_bound({job_id, INT32_MIN}),
                     open_frames_.upper_bound({job_id, INT32_MAX}));
}

absl::StatusOr<Farm::SynchronizeAnswer> Farm::Synchronize(const WorkerReport& report) {
  SynchronizeAnswer answer;
  {
    const MutexLock lock(&mutex_);
    absl::StatusOr<Scheduler::SynchronizeAnswer> decided =
        scheduler_.Synchronize(report, SteadyTime::Now());
    NoteEndedJobs();
    if (!decided.ok()) return decided.status();
    for (Lease& lease : decided->leases) {
      FrameSpec frame = scheduler_.FindFrame(lease.frame)->Spec();
      answer.leases.push_back({std::move(lease), frame.frame_digest, frame.scene, frame.settings});
    }
    answer.next_synchronize = decided->next_synchronize;
    answer.lease_duration = options_.limits.lease_duration;
  }
  if (!report.failures.empty()) SettleEndedJobs();
  Changed();
  return answer;
}

absl::StatusOr<std::string> Farm::FindOutput(uint64_t job_id, int32_t frame_number) const {
  const std::string name = absl::StrCat("jobs/", job_id, "/frames/", frame_number);
  {
    const MutexLock lock(&mutex_);
    const FrameRecord* frame = scheduler_.FindFrame({job_id, frame_number});
    if (frame == nullptr) return absl::NotFoundError(name + ": there is no such frame");
    if (frame->phase != FrameRecord::Phase::kDelivered) {
      return absl::FailedPreconditionError(name + ": the image is not complete yet");
    }
  }
  const absl::StatusOr<std::string> path = store_->OutputPath({job_id, frame_number});
  if (!path.ok()) return path;
  if (absl::Status s = CheckPicture({job_id, frame_number}, *path); !s.ok()) return s;
  return path;
}

}  // namespace sheaf::coordinator
