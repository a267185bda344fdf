// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scheduler: which worker renders which task. A state machine without clock, thread, file or
// network: the time is an argument, decisions are return values, and equal calls give equal
// decisions.
//
//     Synchronize  a worker reports its leases; the answer is the leases that it must hold
//     FindTask     a result came: which task is it, and is it still wanted
//     Accept       ... and it is durable now
//     Compare      ... and it was there before: do they agree
//     Tick         time passed: workers that fell silent lose their leases
//
//     Pause        a user pauses a job: no further task of it is leased
//
// Order of work: jobs by priority, then by shares (fair_share.h: shows, users, jobs), among jobs
// whose requirements the worker meets; for a bounded time, jobs of that priority whose scenes are
// warm in the worker come first (placement.h); within a job a scene that is warm in the worker,
// then a frame that no worker works on yet, then the scene with most work for each worker that has
// it; within a frame returned blocks, then the tile with the fewest samples. A guided frame leases
// only its training until its field is made; other frames fill the gap. A worker that holds nothing
// and finds nothing ready is leased a task that another one holds (a hedge), never its own.
//
// Failures (budgets in limits.h): a worker never gets a task again that it failed by a crash, lack
// of memory or an invalid result. It gets one that it failed for trouble with its disk or network
// only while there is no other worker. A task that uses up its budget is set aside, and the rest of
// its frame continues. A frame with nothing else left is incomplete, and a job with such a frame
// fails once its other frames are done. Failures count by identity (WorkerReport::identity).
// Strangers alone cannot end a job: one of the identities that blame the work must have delivered
// results before, as long as any live identity has. A worker that fails what others render is sick.
//
// Thread safety: none; the owner holds one lock. Cost: O(log n) a lease, no scan over tasks.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/container/btree_map.h"
#include "absl/container/btree_set.h"
#include "absl/status/status.h"
#include "coordinator/core/frame/frame_tasks.h"
#include "coordinator/core/job/limits.h"
#include "coordinator/core/job/owner_work.h"
#include "coordinator/core/job/share_setting.h"
#include "coordinator/core/job/work_left.h"
#include "coordinator/scheduling/counters.h"
#include "coordinator/scheduling/dependencies.h"
#include "coordinator/scheduling/frames_by_digest.h"
#include "coordinator/scheduling/job_record.h"
#include "coordinator/scheduling/lease_table.h"
#include "coordinator/scheduling/loading_losses.h"
#include "coordinator/scheduling/packed_frame.h"
#include "coordinator/scheduling/pending_frames.h"
#include "coordinator/scheduling/placement/placement.h"
#include "coordinator/scheduling/result_checks.h"
#include "coordinator/scheduling/sharing/fair_share.h"
#include "coordinator/scheduling/sharing/held_threads.h"
#include "coordinator/scheduling/sharing/requirement_groups.h"
#include "coordinator/scheduling/task_failures.h"
#include "coordinator/scheduling/worker_table.h"

namespace sheaf::coordinator {

class Scheduler {
 public:
  Scheduler(const Limits& limits, uint64_t first_lease_id);

  // Checks that a job is within the limits (job_check.h) and that there is room for it. Errors:
  // kInvalidArgument, kResourceExhausted.
  absl::Status CheckJob(const JobSpec& spec) const;
  // Checks that its owner may add it to their unfinished jobs; counts refusals. Requires:
  // CheckJobSpec is OK. Errors: kResourceExhausted.
  absl::Status CheckOwner(const JobSpec& spec);
  // Requires: CheckJob is OK, job_id is new.
  void AddJob(const JobSpec& spec);
  // Forgets a job that has ended.
  void RemoveJob(uint64_t job_id);
  // Restores durable state at a start, after AddJob. All Restore* calls of a frame precede its
  // first lease.
  void RestoreEnded(uint64_t job_id, JobPhase phase, const std::string& failure);
  void RestoreFailures(uint64_t job_id, FailureLog failures);
  // sample_count: pixel samples of the whole frame.
  void RestoreDelivered(const FrameId& id, const ResultCost& cost, uint64_t sample_count);
  // Raises each cell to at least this many samples (from the last round, or from the resumed
  // image). Before its parts.
  void RestoreRound(const FrameId& id, std::span<const uint64_t> samples);
  // The guiding field that the frame's parts are made with. Before its parts.
  void RestoreField(const FrameId& id, const BlobDigest& field);
  // Returns kWanted if it is restored. kOutside: the frame does not want that many samples, or does
  // not any longer. Other values: it overlaps a part that was restored.
  FrameTasks::Fit RestorePart(const FrameId& id, const PixelRect& tile, SampleBlock block,
                              const TileCells& cells, const ResultCost& cost,
                              TaskKind kind = TaskKind::kCamera);

  struct SynchronizeAnswer {
    std::vector<Lease> leases;
    absl::Duration next_synchronize;
    bool exits = false;  // An operator asked it to exit, and it holds no leases.
  };
  // Errors: kPermissionDenied (quarantined, or the id is another's), kResourceExhausted (too many
  // workers).
  absl::StatusOr<SynchronizeAnswer> Synchronize(const WorkerReport& report, SteadyTime now);
  // Returns whether anything changed.
  bool Tick(SteadyTime now);

  // The task that a result belongs to.
  struct FoundTask {
    // kUnknown: no live frame has the digest. kMalformed: the frame has no such tile or block.
    // kOtherField: it was made with a guiding field other than the frame's.
    enum class Kind { kWanted, kCovered, kPartial, kUnknown, kMalformed, kOtherField };
    Kind kind = Kind::kUnknown;
    FrameId frame;
    Task task;
  };
  // field: the SHA-256 of the guiding field that the result was made with; empty where it was made
  // without one. Requires: frame_digest is a SHA-256.
  FoundTask FindTask(const std::string& frame_digest, const PixelRect& tile, SampleBlock block,
                     const TileCells& cells, uint64_t lease_id, TaskKind kind = TaskKind::kCamera,
                     const std::string& field = "");
  // The result of a training is about to be accepted: all later results of the frame use this
  // field. Requires: FindTask just said kWanted of the training.
  void SetField(const FrameId& id, const BlobDigest& field);
  // Requires: FindTask just said kWanted of it. Returns whether the frame is rendered now.
  bool Accept(const FrameId& id, const Task& task, uint64_t lease_id, const std::string& worker_id,
              const ResultCost& cost, SteadyTime now);
  // Begins a check of the result just accepted if it is chosen: if draw, uniform in [0, 1), is
  // below the fraction of tasks that are checked. A training is always chosen, because all results
  // of its frame depend on it, unless the fraction is 0. A no-op if no other identity of the
  // profile is live.
  void ConsiderCheck(const FrameId& id, const Task& task, const ResultVersion& merged, double draw);
  // Handles a further result of a finished task: a check, a hedge or a late result.
  CheckVerdict Compare(const FrameId& id, const Task& task, uint64_t lease_id,
                       const std::string& worker_id, const ResultVersion& merged,
                       const ResultVersion& version, const ResultCost& cost, SteadyTime now);
  // Whether the delivery of a rendered frame, or its next round, must wait for checks of its
  // results: only while a live worker can do them, within the limits (check_wait_factor). A frame
  // whose wait timed out does not wait in later rounds until a check of it arrives.
  bool AwaitsChecks(const FrameId& id, SteadyTime now);
  // Waits that began and were not given up, by frame; and the same as text for users, or empty.
  const std::map<FrameId, CheckWait>& check_waits() const { return check_waits_; }
  std::string WhyAwaitsChecks(const FrameId& id) const;
  const ResultChecks& checks() const { return checks_; }
  // The part of an accepted block is lost: renders it again. Parts made with a lost field stay.
  void Revoke(const FrameId& id, const Task& task);
  // Starts the next round of a rendered frame: one sample count per cell, each at least the current
  // one.
  void Grow(const FrameId& id, std::span<const uint64_t> samples);
  // A lease ended without a result. A no-op if the worker does not hold the lease.
  void Fail(const LeaseFailure& failure, const std::string& worker_id, SteadyTime now);
  // For an identity already in quarantine, at most records that it made false results.
  void Quarantine(const std::string& identity, const std::string& reason,
                  bool made_false_results = false);
  // Restores a quarantine from before a restart.
  void RestoreQuarantine(const QuarantineRecord& record);
  // Returns whether the identity was in quarantine, or had a sick worker. Clears the failures of
  // its workers.
  bool LiftQuarantine(const std::string& identity);

  // scheduler_troubles.cc
  // Restores the durable record of a task or frame, after the parts of its job.
  void RestoreTrouble(const TaskTrouble& trouble);
  // Sets the tile, or without one the frame, aside; leased tasks of a tile may still deliver. why:
  // for users. Errors: kNotFound (no such frame or tile), kFailedPrecondition (the job has ended,
  // or the frame is rendered).
  absl::Status Kill(const FrameId& id, std::optional<uint32_t> tile, const std::string& why);
  // Clears the failures of a tile, a frame or a whole job; tasks that were set aside are leased
  // again. Incomplete or closed frames only lose their records: the owner reopens them.
  void Retry(uint64_t job_id, std::optional<int32_t> frame, std::optional<uint32_t> tile);
  // The task failures that changed since the last call, for the owner to store.
  std::map<TaskId, TaskTrouble> TakeTroubles() { return std::exchange(changed_troubles_, {}); }
  // Frames that became incomplete since the last call: their images can be freed.
  std::vector<FrameId> TakeIncompleteFrames() { return std::exchange(incomplete_frames_, {}); }

  // The EXR of a rendered frame is written. Returns whether its job has succeeded with it.
  bool Deliver(const FrameId& id);
  // A no-op if the job has ended.
  void EndJob(uint64_t job_id, JobPhase phase, const std::string& failure);

  // scheduler_control.cc
  // A paused job gets no lease; open leases finish and their results are taken. The clock of its
  // frames stops meanwhile. A no-op if the job has ended or is paused.
  void Pause(uint64_t job_id, SteadyTime now);
  void Resume(uint64_t job_id, SteadyTime now);
  // Errors: kInvalidArgument beyond the limit.
  absl::Status CheckPriority(int32_t priority) const;
  // Requires: CheckPriority is OK.
  void SetPriority(uint64_t job_id, int32_t priority);

  // scheduler_shares.cc
  // Applies from the next lease on; open leases beyond a limit finish. Requires: CheckShareSetting
  // is OK.
  void SetShare(const ShareSubject& subject, const ShareSetting& setting);
  void ResetShare(const ShareSubject& subject);
  // 1 if none was set.
  double WeightOf(const ShareSubject& subject) const;
  // Only explicit settings.
  const std::map<ShareSubject, ShareSetting>& share_settings() const { return share_settings_; }
  const FairShare& shares() const { return shares_; }
  const HeldThreads& held_threads() const { return held_threads_; }

  // scheduler_holds.cc
  // Checks that a new job may depend on the jobs that it names. Errors: kInvalidArgument,
  // kNotFound, kFailedPrecondition.
  absl::Status CheckDependencies(const JobSpec& spec) const;
  // Removes all dependencies of the job.
  void Release(uint64_t job_id);
  // A delivered job is about to be removed: no job waits for it any longer. Before RemoveJob.
  void NoteRemoved(uint64_t job_id);
  // Whether a live job waits for this one.
  bool IsAwaited(uint64_t job_id) const;
  // The worker, known or not, finishes its leases and gets none until Undrain. then_exit: it is
  // then told to exit. The owner removes drains of workers that do not return.
  void Drain(const std::string& worker_id, bool then_exit);
  void Undrain(const std::string& worker_id);

  // Maps manifest digests to reasons (for WaitingReason). No frame of these scenes is leased while
  // they are listed. Replaces the previous map.
  void HoldScenes(std::map<std::string, std::string> reasons) { held_scenes_ = std::move(reasons); }
  const std::map<std::string, std::string>& held_scenes() const { return held_scenes_; }

  // Jobs that the scheduler itself ended since the last call, for the owner to store.
  std::vector<uint64_t> TakeEndedJobs();
  // Jobs with new failures since the last call, for the owner to store; dates them with `stamp`.
  std::set<uint64_t> TakeFailureJobs(absl::Time stamp);
  // Quarantines that began since the last call, for the owner to store; dates them with `stamp`.
  std::vector<QuarantineRecord> TakeQuarantines(absl::Time stamp);
  // Explains why a live job makes no progress; empty if it does or may, or if it is paused.
  std::string WaitingReason(const JobRecord& job) const;

  const std::map<uint64_t, JobRecord>& jobs() const { return jobs_; }
  const FrameRecord* FindFrame(const FrameId& id) const;
  const WorkerTable& workers() const { return workers_; }
  const LeaseTable& leases() const { return leases_; }
  Counters& counters() { return counters_; }
  const Counters& counters() const { return counters_; }

 private:
  FrameRecord& Frame(const FrameId& id);
  // Updates the ready sets after a change to a frame or a job.
  void UpdateReady(JobRecord* job, uint32_t index);
  void UpdateReadyJob(JobRecord* job);
  // scheduler_holds.cc
  // Updates whether the job and its frames are blocked, after a change to jobs that they wait for.
  void JudgeDependencies(JobRecord* job);
  void JudgeFrame(JobRecord* job, uint32_t index);
  // Does the same for all jobs that wait for a job, or for a frame of it.
  void JudgeDependents(uint64_t job_id);
  void JudgeDependentsOn(const FrameId& frame);

  bool MayOpen(const FrameRecord& frame) const;
  void Open(JobRecord* job, uint32_t index);
  void Close(JobRecord* job, uint32_t index, FrameRecord::Phase phase);

  // scheduler_grant.cc
  // How many leases the worker should hold: as many as it asks for, within its proven capacity.
  size_t LeasesWanted(const WorkerRecord& worker) const;
  bool MayHoldMore(const WorkerRecord& worker) const;
  bool Grant(WorkerRecord* worker, SteadyTime now);
  bool GrantFromFrames(JobRecord* job, const JobRecord::FrameSet& frames, WorkerRecord* worker,
                       SteadyTime now);
  bool GrantFromFrame(JobRecord* job, uint32_t index, WorkerRecord* worker, SteadyTime now);
  bool GrantByOpening(JobRecord* job, uint32_t index, WorkerRecord* worker, SteadyTime now);
  bool Hedge(WorkerRecord* worker, SteadyTime now);
  // Whether the task of this lease, its first, may be leased to the worker too.
  bool MayHedge(const Lease& first, const WorkerRecord& worker, SteadyTime now);
  void AddLease(JobRecord* job, FrameRecord* frame, const Task& task, WorkerRecord* worker,
                bool is_check, SteadyTime now);
  int LeaseSlots(const JobRecord& job) const;
  uint64_t BlockSamplesMax(const JobRecord& job, const FrameRecord& frame,
                           const WorkerRecord& worker, const FrameTasks::FreshBlock& block) const;
  // Compares the cost of a result with the frame's earlier results. Before it is counted.
  void NoteSpeed(const FrameRecord& frame, const std::string& worker_id, uint64_t samples,
                 const ResultCost& cost);
  bool MayRender(const FrameRecord& frame, const TaskId& task, const WorkerRecord& worker,
                 SteadyTime now) const;
  bool MayOpenFor(const FrameRecord& frame, const WorkerRecord& worker) const;
  // Whether the task needs a guiding field that is lost and not yet made again.
  static bool AwaitsField(const FrameRecord& frame, uint32_t tile);
  // Whether a frame that this worker could render is between rounds, or will soon be.
  bool RoundIsSoon(const WorkerRecord& worker, SteadyTime now) const;
  absl::Duration NextSynchronize(const WorkerRecord& worker, SteadyTime now) const;
  absl::Duration BusyInterval() const;

  // scheduler_shares.cc
  // Leases from the first job, in order of shares, that has a task for the worker.
  bool GrantFirstRender(WorkerRecord* worker, SteadyTime now);
  static int ThreadsPerLease(const WorkerRecord& worker);
  // Whether one more lease of the worker stays within the subject's limit.
  bool KeepsLimit(const ShareSubject& subject, const WorkerRecord& worker) const;
  // Whether the worker meets the job's requirements, and one more lease stays within all limits.
  bool MayServe(const JobRecord& job, const WorkerRecord& worker) const;
  // Charges a new lease to its job, user and show.
  void ChargeLease(const JobRecord& job, const WorkerRecord& worker, const Lease& lease,
                   uint64_t sample_count);
  void ChargeResult(const Lease& lease, const ResultCost& cost, SteadyTime now);
  // Whether the identity of a live worker that meets the job's requirements is accepted. A scan
  // over workers where the job requires tags or memory.
  bool AnyIdentityFits(const JobSpec& spec,
                       const std::function<bool(const std::string&)>& accept) const;
  // Explains why no worker may render any task of the job: unmet requirements, or a limit.
  std::string WhyNobodyMay(const JobRecord& job) const;

  // scheduler_placement.cc
  // front: jobs in order of service. Warm scenes may override the order among equal priorities
  // (placement.h).
  bool GrantPlaced(std::span<const uint64_t> front, WorkerRecord* worker, SteadyTime now);
  bool GrantOfEquals(std::span<const uint64_t> equals, WorkerRecord* worker, SteadyTime now);
  bool MayPassOver(const JobRecord& job, const WorkerRecord& worker, SteadyTime now) const;
  void NotePassedOver(std::span<const uint64_t> jobs, SteadyTime now);
  bool GrantWarmOfEquals(std::span<const uint64_t> equals, WorkerRecord* worker, SteadyTime now);
  bool GrantColdOfEquals(std::span<const uint64_t> equals, WorkerRecord* worker, SteadyTime now);
  // Grants work of the job for scenes that the worker has; the next, any work of the job.
  bool GrantWarm(JobRecord* job, WorkerRecord* worker, SteadyTime now);
  bool GrantCold(JobRecord* job, WorkerRecord* worker, SteadyTime now);
  // The scene with which a cold worker would begin the job; empty if it cannot.
  std::string ColdScene(JobRecord* job);
  // Approximate number of pixel samples of the job that can be leased.
  double SamplesToLease(const JobRecord& job) const;
  // Whether the job's work may be leased to the worker now.
  bool IsLeased(const JobRecord& job, const WorkerRecord& worker) const;
  // Sorts by priority, then as in `front`, whose jobs come before others.
  void SortByRight(std::span<const uint64_t> front, std::vector<uint64_t>* jobs) const;
  // The oldest jobs with open frames, in that order.
  std::vector<uint64_t> OpenedJobs(const WorkerRecord& worker) const;
  // Update warm_workers_, scene_jobs_ and opened_jobs_ after a change to a worker, or to the job's
  // work of a scene.
  void NoteWarm(const WorkerRecord& worker);
  void NoteWork(JobRecord* job, const PackedDigest& scene);

  bool IsHeld(const FrameRecord& frame) const;  // HoldScenes named the frame's scene.
  bool RefuseForCache(const Lease& lease, const LeaseFailure& failure, SteadyTime now);
  // The identities of which no live worker's cache has room for the job.
  std::set<std::string> IdentitiesWithoutRoom(const JobRecord& job);
  std::string WhyNoCacheHolds(const JobRecord& job) const;  // Empty if not known.

  // scheduler_checks.cc
  // urgent_only: those whose scene is warm in the worker, or whose frame waits for nothing else.
  bool GrantCheck(WorkerRecord* worker, bool urgent_only, SteadyTime now);
  bool MayCheck(const TaskId& task, const WorkerRecord& worker, bool urgent_only);
  // Whether any live identity may do the check; with proven_only, any that has delivered results.
  bool AnyMayCheck(const TaskId& task, bool proven_only);
  SteadyTime CheckWaitEnd(const TaskId& task, const CheckWait& wait);
  void DropCheckLeases(const TaskId& task);
  void DropChecks(const FrameId& id);
  // Counts a worker's delivery under a lease granted at grant_time.
  void NoteDelivery(const std::string& worker_id, uint64_t samples, const ResultCost& cost,
                    SteadyTime grant_time, SteadyTime now);

  // scheduler_failures.cc
  // Whether a live worker outside `failed` meets the job's requirements.
  bool OthersLive(const JobSpec& spec, const std::set<std::string>& failed) const;
  bool OtherIdentitiesLive(const JobSpec& spec, const std::set<std::string>& failed) const;
  // Whether failures reported by these identities can end a job: one of them has delivered results,
  // or no live identity has. Scans the live identities if all of them are strangers.
  bool AreBelieved(const std::string& numeric_profile,
                   const std::set<std::string>& identities) const;
  std::string Quote(const Lease& lease, const LeaseFailure& failure) const;
  void DropLease(uint64_t lease_id, bool put_back);
  void ApplyReport(WorkerRecord* worker, const WorkerReport& report, SteadyTime now);
  void LoseLeases(const std::string& worker_id, SteadyTime now);
  void KeepFailure(const Lease& lease, const LeaseFailure& failure);
  void CountTaskFailure(const Lease& lease, const LeaseFailure& failure, SteadyTime now);
  // Sets doubtful tasks aside that every identity failed and whose failures are now believed.
  void JudgeDoubtfulTasks();
  void RefuseFrame(const Lease& lease, const LeaseFailure& failure);
  void JudgeScene(const FrameId& id);
  void JudgeDoubtfulScenes();
  void BlameWorker(const std::string& worker_id, const Lease& lease, const LeaseFailure& failure,
                   SteadyTime now);
  // Counts the job against workers that failed a task which another identity rendered.
  void BlameSuspects(const std::map<std::string, std::string>& suspects, uint64_t job_id,
                     const std::string& rendered_by, SteadyTime now);
  // Another identity rendered a task that the worker failed. After enough such jobs the worker is
  // sick.
  void NoteFailedJob(WorkerRecord* worker, uint64_t job_id, const std::string& words,
                     SteadyTime now);
  void DropLeasesOf(const WorkerRecord& worker);
  absl::Duration RetryDelay(int failure_count) const;

  // scheduler_loading.cc
  // A worker renders or has rendered the frame.
  void NoteLoaded(const FrameId& id);
  // The lease's worker vanished while it loaded the frame's scene.
  void CountLoadingLoss(const Lease& lease);
  void JudgeLoadingLosses(const FrameId& id);
  // Derives them from the known failures of a job. Before its parts.
  void RestoreLoadingLosses(JobRecord* job);

  // scheduler_troubles.cc
  TaskFailures& FailuresOf(FrameRecord* frame, const Lease& lease);
  void NoteTrouble(const TaskId& id, const TaskFailures& failures);
  void ForgetTrouble(FrameRecord* frame, const TaskId& id);
  void ForgetTroubles(FrameRecord* frame);
  // Sets the task aside, at once or when its last lease ends.
  void SetAside(FrameRecord* frame, const TaskId& id, const std::string& why);
  void GiveUpFrame(JobRecord* job, uint32_t index, const std::string& why);
  void CloseIncomplete(JobRecord* job, uint32_t index);
  void CloseStuckFrames();
  // Fails a job whose frames are all delivered or incomplete.
  void JudgeIncompleteJob(JobRecord* job);
  // Refuses the frame to a worker that lacks the memory for it, as long as that helps.
  void RefuseForMemory(const FrameId& id, const std::string& worker_id);
  // Names the failures that keep the present workers from the job's tasks; empty if there are none.
  std::string WhyOthersAreNeeded(const JobRecord& job) const;
  std::string WhatEndsTheWait(const JobRecord& job, const FrameRecord& frame) const;
  std::string TaskFailureText(const FrameRecord& frame, const TaskFailures& failures) const;

  const Limits limits_;
  std::map<uint64_t, JobRecord> jobs_;
  FairShare shares_{limits_};  // Live jobs.
  HeldThreads held_threads_;
  RequirementGroups requirement_groups_;  // Live jobs.
  std::map<ShareSubject, ShareSetting> share_settings_;
  Dependents dependents_;
  std::map<std::string, std::set<uint64_t>> opened_jobs_;  // With open frames, by numeric profile.
  WarmWorkers warm_workers_;
  SceneJobs scene_jobs_;  // Jobs with few scenes (placement_scenes_max).
  FramesByDigest live_frames_;
  std::set<FrameId> round_frames_;     // Open, and rendered in rounds.
  std::set<FrameId> doubtful_frames_;  // With a scene failure that is not yet confirmed.
  std::set<TaskId> doubtful_tasks_;    // With too many failures, not yet believed.
  std::map<std::string, std::string> held_scenes_;
  WorkerTable workers_;
  LeaseTable leases_;
  ResultChecks checks_;
  std::map<FrameId, CheckWait> check_waits_;
  Counters counters_;
  int64_t open_pixels_ = 0;
  int live_job_count_ = 0;
  std::map<std::string, OwnerWork> owner_work_;  // Work of live jobs, by owner.
  std::vector<uint64_t> ended_jobs_;
  std::set<uint64_t> failure_jobs_;
  std::set<FrameId> stuck_frames_;  // Perhaps with only set-aside tasks left.
  std::map<TaskId, TaskTrouble> changed_troubles_;
  std::vector<FrameId> incomplete_frames_;
  std::vector<QuarantineRecord> quarantines_;  // Not yet taken.
};

}  // namespace sheaf::coordinator
