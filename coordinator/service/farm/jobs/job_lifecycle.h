// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobLifecycle: jobs from their creation to their durable end: create, pause, resume, prioritize,
// cancel, refine, restore after a start; and the removal of their stored data. A change is durable
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
#include "coordinator/core/job/job_verbs.h"
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

  // Restores all stored jobs into the scheduler. Call once, first. Errors: those of the store;
  // kDataLoss.
  absl::Status Load();

  // As in Farm.
  absl::StatusOr<uint64_t> Create(JobSpec spec, const std::string& request_id);

  // The verbs (job_verbs.h), by name. OK means: the change is durable, or there was none to make.
  // Errors of all: kNotFound; kUnavailable, kResourceExhausted (the disk); those named here.
  //
  // A no-op if the job was cancelled. Errors: kFailedPrecondition (it has ended otherwise).
  absl::Status CancelJob(uint64_t job_id, const JobArguments& arguments);
  // A paused job gets no new leases until it is resumed. Errors: kFailedPrecondition (it has
  // ended).
  absl::Status PauseJob(uint64_t job_id, const JobArguments& arguments);
  absl::Status ResumeJob(uint64_t job_id, const JobArguments& arguments);
  // Errors: kInvalidArgument; kFailedPrecondition (it has ended).
  absl::Status SetJobPriority(uint64_t job_id, const JobArguments& arguments);
  // Continues a job that succeeded, from its kept parts; missing parts are rendered again. A no-op
  // if all of its frames are good enough. Errors: kFailedPrecondition (it has not succeeded);
  // kInvalidArgument (fewer samples than it has).
  absl::Status RefineJob(uint64_t job_id, const JobArguments& arguments);
  // Releases a job from its dependencies, whatever their state. Errors: kFailedPrecondition (it
  // waits for none, or has ended).
  absl::Status ReleaseJob(uint64_t job_id, const JobArguments& arguments);
  // Continues frames that wait for approval: these or, if none is named, all that wait now. A no-op
  // for approved frames. Requires: no result is taken meanwhile. Errors: kFailedPrecondition (the
  // job or a frame does not wait).
  absl::Status ApproveFrames(uint64_t job_id, const JobArguments& arguments);
  // Clears the failures of a job, of a frame of it or of a task, and leases tasks again that were
  // set aside; a failed job continues. Requires: no result is taken meanwhile. Errors:
  // kFailedPrecondition (it has ended otherwise); kResourceExhausted (the owner's limits).
  absl::Status RetryTasks(uint64_t job_id, const JobArguments& arguments);
  // Sets a task, or a whole frame, aside until it is retried. Errors: as RetryTasks;
  // kInvalidArgument (no frame); kFailedPrecondition if it is rendered.
  absl::Status KillTasks(uint64_t job_id, const JobArguments& arguments);
  // A pinned job keeps all its stored data until it is unpinned.
  absl::Status PinJob(uint64_t job_id, const JobArguments& arguments);
  absl::Status UnpinJob(uint64_t job_id, const JobArguments& arguments);
  // Removes a job that has ended, with its images, even if it has only just ended. Errors:
  // kFailedPrecondition (it has not ended, is pinned, or another job waits for it).
  absl::Status DeleteJob(uint64_t job_id, const JobArguments& arguments);

  void NotePilotRequest(uint64_t job_id);
  absl::Status LiftQuarantine(const std::string& identity);

  // Removes the stored results of an identity that made false ones; the frames that hold them are
  // rendered again. Requires: no result is taken meanwhile. Errors: those of the store, and
  // kUnavailable while the disk does not remove all of them. Call it again after an error; no frame
  // is corrected twice.
  absl::Status RemoveResultsOf(const std::string& identity);
  // Removes the parts of a frame whose guiding field was lost and trained to a different result;
  // they are rendered again. Requires and errors: as RemoveResultsOf.
  absl::Status RemovePartsOfLostField(const FrameId& id);
  // Replaces the job's warning about its images.
  absl::Status SetWarning(uint64_t job_id, const std::string& text);

  // Renders delivered frames again, from their kept parts. A no-op for a job that has not
  // succeeded: it is being refined.
  absl::Status RemakeFrames(uint64_t job_id, const std::set<int32_t>& numbers);

  // upkeep/job_retention.cc
  // Each removes stored data of an unpinned job whose end is durable. Errors: kNotFound;
  // kFailedPrecondition (not such a job); those of the store. After an error RemoveParts may have
  // removed some parts; call it again for the rest.
  absl::Status RemoveParts(uint64_t job_id, absl::Time now);
  absl::Status RemovePreviews(uint64_t job_id);  // Also for a removed job.
  absl::Status RemoveJob(uint64_t job_id);  // kFailedPrecondition also if it has only just ended.
  // How often ended jobs were reopened since the coordinator started.
  uint64_t ReopenCount() ABSL_LOCKS_EXCLUDED(settle_mutex_);
  // Calls `act` while no job can be reopened, if none was since ReopenCount was `seen`. Returns
  // whether it did.
  bool IfNoneReopened(uint64_t seen, const std::function<void()>& act)
      ABSL_LOCKS_EXCLUDED(settle_mutex_);

  // Advances time: marks workers as lost, expires leases, and cancels unrequested pilots. Returns
  // whether anything changed that a FarmView shows.
  bool Tick();
  // Stores the ends of jobs and their failures, and removes their parts. Concurrent calls wait
  // until that is durable. The next call retries writes that the disk refused.
  void SettleEnded();
  // Stores new failures and quarantines. The next call retries writes that the disk refused.
  void SaveFailures() ABSL_LOCKS_EXCLUDED(settle_mutex_);
  // Removes parts of delivered frames, the oldest first, while there are more than the limit.
  void LimitKeptParts();

 private:
  absl::Status SetPaused(uint64_t job_id, bool paused);
  absl::Status SetPinned(uint64_t job_id, bool pinned);

  // By frame: its tiles with parts on disk.
  using TilesOnDisk = std::map<FrameId, std::set<uint32_t>>;

  // Requires: no job that the new one waits for is removed meanwhile.
  absl::StatusOr<uint64_t> CreateNew(JobSpec spec, const std::string& request_id);
  void CancelForgottenPilots() ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  void SaveNewQuarantines() ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  void SaveNewFailures() ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  // Errors: those of the store; the next call tries again.
  absl::Status SaveNewTroubles() ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  void EraseOpenFrames(uint64_t job_id);

  // job_restore.cc
  // Restores a job into the scheduler from its durable state: its delivered frames, rounds (with
  // cells if it is live) and, if it is live, parts and the images that its frames resume. parts:
  // null if a live job cannot continue. Requires: the scheduler does not have the job; the job has
  // an account.
  void RestoreJob(const StoredJob& job, std::vector<StoredRound> rounds,
                  const JobStore::LoadedParts* parts, const ResumedCounts& resumed)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  void RestoreLiveJob(const StoredJob& job, const JobStore::LoadedParts& parts, TilesOnDisk on_disk)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // By frame, the guiding field of its parts: the stored one, or the one named by its parts.
  static std::map<FrameId, BlobDigest> FieldsOf(const std::vector<PartRow>& rows);
  // Removes a part that conflicts with those before it: it was superseded while it was written and
  // the disk refused to remove it, or its frame was refined.
  void RemoveUnusable(const PartRow& row, FrameTasks::Fit fit)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Requires: after AddJob, before the job's parts.
  void RestoreRounds(const StoredJob& job, std::vector<StoredRound> rounds)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Raises the cells to the samples that the resumed images have: after AddJob, before rounds.
  void RestoreResumed(uint64_t job_id, const ResumedCounts& resumed)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Restores the parts that the resumed images replace: before other parts.
  TilesOnDisk RestoreResumedParts(uint64_t job_id, const ResumedCounts& resumed)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);

  // job_refinement.cc
  absl::Status CheckRefinement(const JobRecord& job, const Refinement& refinement) const;
  // Makes a frame whose parts were removed continue from its delivered image, if it can.
  void ContinueFromImage(const JobSpec& job, JobStore::ReopenedFrame* frame) const;
  // The job with all its frames, for RestoreJob.
  StoredJob StoredJobOf(const JobRecord& record) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // By frame.
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> RoundsOf(uint64_t job_id) const;
  // The parts of a job, without the given ones and those no longer needed. Lost parts become parts
  // no longer needed. Errors: those of JobStore::LoadParts.
  absl::StatusOr<JobStore::LoadedParts> LoadPartsOf(uint64_t job_id,
                                                    const std::vector<PartRow>& without = {});
  // Continues these frames of a job, without the false parts, which are removed. Requires: the job
  // has ended, or no result is taken meanwhile. Errors: those of the store; no part is removed
  // then, and the call can be repeated.
  absl::Status ReopenFrames(StoredJob job, const std::vector<JobStore::ReopenedFrame>& reopened,
                            const std::vector<PartRow>& false_parts = {},
                            bool may_have_failed = false)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  // Reopens the job's frames that ended without an image.
  absl::Status ReopenUndelivered(uint64_t job_id, std::optional<int32_t> frame,
                                 std::optional<uint32_t> task)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  // Removes a job from the tables, before RestoreJob.
  void TakeOut(uint64_t job_id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);

  // upkeep/job_retention.cc
  absl::Status RequireUnused(uint64_t job_id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  absl::Status RemoveUnused(uint64_t job_id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);

  // job_correction.cc
  // why: the finding about the parts, for users.
  absl::Status CorrectJob(uint64_t job_id, const std::string& why,
                          const std::vector<PartRow>& false_parts)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  void RemoveFalse(const std::vector<PartRow>& parts);
  // The false parts of an identity, with those that others made with its guiding fields. Fields
  // come last: if a stop interrupts the removal, a remaining field leads to the rest.
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
  // Held by one call at a time that stores the ends of jobs, reopens or pauses a job, or removes
  // its stored data. Taken before the tables' mutex.
  Mutex settle_mutex_;
};

// Errors: kFailedPrecondition.
absl::Status RequireSucceeded(const JobRecord& job);

}  // namespace sheaf::coordinator
