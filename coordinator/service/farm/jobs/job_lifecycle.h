// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobLifecycle: jobs from their creation to their durable end: create, pause, resume, prioritize,
// cancel, refine, restore after a start; and what is kept of them afterwards. A change is durable
// before it is acknowledged.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "coordinator/service/farm/state/delivery_queue.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_options.h"
#include "coordinator/service/farm/state/farm_signals.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/farm/state/part_removals.h"
#include "coordinator/service/farm/state/resumed_frames.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/round_previews.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class JobLifecycle {
 public:
  // The objects that it works on; all must outlive it.
  struct Parts {
    FarmTables& tables;
    JobStore& store;
    PartRemovals& removals;
    RoundPreviews& previews;
    const ResumedFrames& resumed;
    DeliveryQueue& queue;
    DiskState& disk;
    FarmSignals& signals;
  };
  JobLifecycle(const FarmOptions& options, std::string numeric_profile, const Parts& parts)
      : options_(options),
        numeric_profile_(std::move(numeric_profile)),
        tables_(parts.tables),
        store_(parts.store),
        removals_(parts.removals),
        previews_(parts.previews),
        resumed_(parts.resumed),
        queue_(parts.queue),
        disk_(parts.disk),
        signals_(parts.signals) {}

  // Puts all stored jobs into the scheduler. Call once, first. Errors: those of the store;
  // kDataLoss.
  absl::Status Load();

  // As Farm has them.
  absl::StatusOr<uint64_t> Create(JobSpec spec, const std::string& request_id);
  absl::Status Cancel(uint64_t job_id);
  absl::Status SetPaused(uint64_t job_id, bool paused);
  absl::Status SetPriority(uint64_t job_id, int32_t priority);
  absl::Status Refine(uint64_t job_id, const Refinement& refinement);
  // These two in holds/job_holds.cc. Requires for Approve: no result is taken meanwhile.
  absl::Status Release(uint64_t job_id);
  absl::Status Approve(uint64_t job_id, const std::vector<int32_t>& numbers);
  // Requires for Retry: no result is taken meanwhile.
  absl::Status Retry(uint64_t job_id, std::optional<int32_t> frame, std::optional<uint32_t> task);
  absl::Status Kill(const FrameId& id, std::optional<uint32_t> task, const std::string& why);
  void NotePilotRequest(uint64_t job_id);
  absl::Status LiftQuarantine(const std::string& identity);

  // Removes the stored results of an identity that made false ones; the frames that hold them are
  // rendered again. Requires: no result is taken meanwhile. Errors: those of the store, and
  // kUnavailable while the disk does not remove all of them. Then it can be called again, which
  // corrects no frame twice.
  absl::Status RemoveResultsOf(const std::string& identity);
  // Removes the parts of a frame whose guiding field was lost and came out otherwise; they are
  // rendered again. Requires and errors: as RemoveResultsOf.
  absl::Status RemovePartsOfLostField(const FrameId& id);
  // Replaces what the users of a job should know of its images.
  absl::Status SetWarning(uint64_t job_id, const std::string& text);

  // Renders delivered frames again, from what is kept of their parts. Does nothing for a job that
  // has not succeeded, because it is refined meanwhile.
  absl::Status RemakeFrames(uint64_t job_id, const std::set<int32_t>& numbers);

  // upkeep/job_retention.cc
  // A pinned job keeps all that is kept of it. Errors: kNotFound; kUnavailable (the disk).
  absl::Status SetPinned(uint64_t job_id, bool pinned);
  // Each removes what is kept of a job that has ended, which is durable, and is not pinned. Errors:
  // kNotFound; kFailedPrecondition (it is not such a job); those of the store. After those of
  // RemoveParts some are gone, and the rest at another call.
  absl::Status RemoveParts(uint64_t job_id, absl::Time now);
  absl::Status RemovePreviews(uint64_t job_id);  // Also of a job that is not there any more.
  absl::Status RemoveJob(uint64_t job_id);  // kFailedPrecondition also if it has only just ended.
  // The same at a person's request, also if it has only just ended.
  absl::Status DeleteJob(uint64_t job_id);
  // How often jobs that had ended began again, in this life.
  uint64_t ReopenCount() ABSL_LOCKS_EXCLUDED(settle_mutex_);
  // Calls `act` while none can, if none has since ReopenCount was `seen`. Returns whether it did.
  bool IfNoneReopened(uint64_t seen, const std::function<void()>& act)
      ABSL_LOCKS_EXCLUDED(settle_mutex_);

  // Lets time pass: workers are lost, leases expire, and pilots that nobody has asked for are
  // cancelled. Returns whether anything changed that a FarmView shows.
  bool Tick();
  // Writes down the ends of jobs that have ended, and their failures, and removes their parts.
  // Concurrent calls wait until that is durable. Writes that the disk refuses are tried again by
  // the next call.
  void SettleEnded();
  // Writes down failures and quarantines that are new. Writes that the disk refuses are tried
  // again.
  void SaveFailures() ABSL_LOCKS_EXCLUDED(settle_mutex_);
  // Removes parts of delivered frames, the oldest first, while there are more than the limit.
  void LimitKeptParts();

 private:
  // By frame: its tiles of which parts are on disk.
  using TilesOnDisk = std::map<FrameId, std::set<uint32_t>>;

  // Requires: a job that the new one waits for is not removed meanwhile.
  absl::StatusOr<uint64_t> CreateNew(JobSpec spec, const std::string& request_id);
  void CancelForgottenPilots() ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  void SaveNewQuarantines() ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  void SaveNewFailures() ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  // Errors: those of the store; then it is tried again by the next call.
  absl::Status SaveNewTroubles() ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  void EraseOpenFrames(uint64_t job_id);

  // job_restore.cc
  // Puts a job that the scheduler does not know into it, with what is durable of it: its delivered
  // frames, rounds (with cells where it is live) and, where it is live, parts and the images that
  // its frames resume. parts: null where a live job cannot continue. Requires: the job has an
  // account.
  void RestoreJob(const StoredJob& job, std::vector<StoredRound> rounds,
                  const JobStore::LoadedParts* parts, const ResumedCounts& resumed)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  void RestoreLiveJob(const StoredJob& job, const JobStore::LoadedParts& parts, TilesOnDisk on_disk)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // By frame, the guiding field of its parts: the stored one, or that of which its parts say that
  // they were made with it.
  static std::map<FrameId, BlobDigest> FieldsOf(const std::vector<PartRow>& rows);
  // Removes a part that does not fit beside those before it: it was superseded while it was
  // written, and the disk refused to remove it, or its frame was refined.
  void RemoveUnusable(const PartRow& row, FrameTasks::Fit fit)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Requires: after AddJob, before the job's parts.
  void RestoreRounds(const StoredJob& job, std::vector<StoredRound> rounds)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Gives the cells at least the samples that they have: after AddJob, before rounds.
  void RestoreResumed(uint64_t job_id, const ResumedCounts& resumed)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Puts those parts back that the resumed images stand for: before other parts.
  TilesOnDisk RestoreResumedParts(uint64_t job_id, const ResumedCounts& resumed)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);

  // job_refinement.cc
  absl::Status CheckRefinement(const JobRecord& job, const Refinement& refinement) const;
  // Has a frame whose parts were removed continue from its delivered image, where it can.
  void ContinueFromImage(const JobSpec& job, JobStore::ReopenedFrame* frame) const;
  // The job with all its frames, to be put into the scheduler again.
  StoredJob StoredJobOf(const JobRecord& record) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // By frame.
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> RoundsOf(uint64_t job_id) const;
  // The parts of a job, without the given ones and those that nothing needs any more; lost ones are
  // of the latter from now on. Errors: those of JobStore::LoadParts.
  absl::StatusOr<JobStore::LoadedParts> LoadPartsOf(uint64_t job_id,
                                                    const std::vector<PartRow>& without = {});
  // Continues these frames of a job, without the false parts, which are removed. Requires: the job
  // has ended, or no result is taken meanwhile. Errors: those of the store; then no part is removed
  // and it can be called again.
  absl::Status ReopenFrames(StoredJob job, const std::vector<JobStore::ReopenedFrame>& reopened,
                            const std::vector<PartRow>& false_parts = {},
                            bool may_have_failed = false)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  // Opens those of a job's frames again that have ended without image.
  absl::Status ReopenUndelivered(uint64_t job_id, std::optional<int32_t> frame,
                                 std::optional<uint32_t> task)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  // Takes a job out of the tables, as it is before RestoreJob.
  void TakeOut(uint64_t job_id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);

  // upkeep/job_retention.cc
  absl::Status RequireUnused(uint64_t job_id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  absl::Status RemoveUnused(uint64_t job_id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);

  // job_correction.cc
  // why: what was found of the parts, for people.
  absl::Status CorrectJob(uint64_t job_id, const std::string& why,
                          const std::vector<PartRow>& false_parts)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  void RemoveFalse(const std::vector<PartRow>& parts);
  // The false parts of an identity, with those that others made with its guiding fields. Fields
  // come last: while one is there, a stop in between leaves the rest to be found again.
  absl::StatusOr<std::vector<PartRow>> WithPartsOfFields(uint64_t job_id,
                                                         std::vector<PartRow> false_parts);

  const FarmOptions options_;
  const std::string numeric_profile_;
  FarmTables& tables_;
  JobStore& store_;
  PartRemovals& removals_;
  RoundPreviews& previews_;
  const ResumedFrames& resumed_;
  DeliveryQueue& queue_;
  DiskState& disk_;
  FarmSignals& signals_;
  uint64_t reopen_count_ ABSL_GUARDED_BY(settle_mutex_) = 0;
  // Held by one call at a time that writes down the ends of jobs, reopens or pauses one, or removes
  // what is kept of one. Taken before the tables' mutex.
  Mutex settle_mutex_;
};

// Errors: kFailedPrecondition.
absl::Status RequireSucceeded(const JobRecord& job);

}  // namespace sheaf::coordinator
