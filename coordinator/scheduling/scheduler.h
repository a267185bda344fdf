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
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "coordinator/scheduling/check_leases.h"
#include "coordinator/scheduling/frame_phases.h"
#include "coordinator/scheduling/lease_failures.h"
#include "coordinator/scheduling/set_aside.h"
#include "coordinator/scheduling/share_limits.h"
#include "coordinator/scheduling/waiting_reason.h"
#include "coordinator/scheduling/work_holds.h"
#include "coordinator/scheduling/work_state.h"

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
  void RestoreFailures(uint64_t job_id, FailureLog failures) {
    scheduling::RestoreFailures(state_, job_id, std::move(failures));
  }
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
  void ConsiderCheck(const FrameId& id, const Task& task, const ResultVersion& merged,
                     double draw) {
    scheduling::ConsiderCheck(state_, id, task, merged, draw);
  }
  // Handles a further result of a finished task: a check, a hedge or a late result.
  CheckVerdict Compare(const FrameId& id, const Task& task, uint64_t lease_id,
                       const std::string& worker_id, const ResultVersion& merged,
                       const ResultVersion& version, const ResultCost& cost, SteadyTime now) {
    return scheduling::Compare(state_, id, task, lease_id, worker_id, merged, version, cost, now);
  }
  // Whether the delivery of a rendered frame, or its next round, must wait for checks of its
  // results: only while a live worker can do them, within the limits (check_wait_factor). A frame
  // whose wait timed out does not wait in later rounds until a check of it arrives.
  bool AwaitsChecks(const FrameId& id, SteadyTime now) {
    return scheduling::AwaitsChecks(state_, id, now);
  }
  // Waits that began and were not given up, by frame; and the same as text for users, or empty.
  const std::map<FrameId, CheckWait>& check_waits() const { return state_.checking.waits; }
  std::string WhyAwaitsChecks(const FrameId& id) const {
    return scheduling::WhyAwaitsChecks(state_, id);
  }
  const ResultChecks& checks() const { return state_.checking.checks; }
  // The part of an accepted block is lost: renders it again. Parts made with a lost field stay.
  void Revoke(const FrameId& id, const Task& task);
  // Starts the next round of a rendered frame: one sample count per cell, each at least the current
  // one.
  void Grow(const FrameId& id, std::span<const uint64_t> samples);
  // A lease ended without a result. A no-op if the worker does not hold the lease.
  void Fail(const LeaseFailure& failure, const std::string& worker_id, SteadyTime now) {
    scheduling::Fail(state_, failure, worker_id, now);
  }
  // For an identity already in quarantine, at most records that it made false results.
  void Quarantine(const std::string& identity, const std::string& reason,
                  bool made_false_results = false) {
    scheduling::Quarantine(state_, identity, reason, made_false_results);
  }
  // Restores a quarantine from before a restart.
  void RestoreQuarantine(const QuarantineRecord& record) {
    scheduling::RestoreQuarantine(state_, record);
  }
  // Returns whether the identity was in quarantine, or had a sick worker. Clears the failures of
  // its workers.
  bool LiftQuarantine(const std::string& identity) {
    return scheduling::LiftQuarantine(state_, identity);
  }

  // Restores the durable record of a task or frame, after the parts of its job.
  void RestoreTrouble(const TaskTrouble& trouble) { scheduling::RestoreTrouble(state_, trouble); }
  // Sets the tile, or without one the frame, aside; leased tasks of a tile may still deliver. why:
  // for users. Errors: kNotFound (no such frame or tile), kFailedPrecondition (the job has ended,
  // or the frame is rendered).
  absl::Status Kill(const FrameId& id, std::optional<uint32_t> tile, const std::string& why) {
    return scheduling::Kill(state_, id, tile, why);
  }
  // Clears the failures of a tile, a frame or a whole job; tasks that were set aside are leased
  // again. Incomplete or closed frames only lose their records: the owner reopens them.
  void Retry(uint64_t job_id, std::optional<int32_t> frame, std::optional<uint32_t> tile) {
    scheduling::Retry(state_, job_id, frame, tile);
  }
  // The task failures that changed since the last call, for the owner to store.
  std::map<TaskId, TaskTrouble> TakeTroubles() { return std::exchange(state_.news.troubles, {}); }
  // Frames that became incomplete since the last call: their images can be freed.
  std::vector<FrameId> TakeIncompleteFrames() {
    return std::exchange(state_.news.incomplete_frames, {});
  }

  // The EXR of a rendered frame is written. Returns whether its job has succeeded with it.
  bool Deliver(const FrameId& id);
  // A no-op if the job has ended.
  void EndJob(uint64_t job_id, JobPhase phase, const std::string& failure) {
    scheduling::EndJob(state_, job_id, phase, failure);
  }

  // A paused job gets no lease; open leases finish and their results are taken. The clock of its
  // frames stops meanwhile. A no-op if the job has ended or is paused.
  void Pause(uint64_t job_id, SteadyTime now);
  void Resume(uint64_t job_id, SteadyTime now);
  // Errors: kInvalidArgument beyond the limit.
  absl::Status CheckPriority(int32_t priority) const;
  // Requires: CheckPriority is OK.
  void SetPriority(uint64_t job_id, int32_t priority);

  // Applies from the next lease on; open leases beyond a limit finish. Requires: CheckShareSetting
  // is OK.
  void SetShare(const ShareSubject& subject, const ShareSetting& setting) {
    scheduling::SetShare(state_, subject, setting);
  }
  void ResetShare(const ShareSubject& subject) { scheduling::ResetShare(state_, subject); }
  // 1 if none was set.
  double WeightOf(const ShareSubject& subject) const {
    return scheduling::WeightOf(state_, subject);
  }
  // Only explicit settings.
  const std::map<ShareSubject, ShareSetting>& share_settings() const {
    return state_.sharing.settings;
  }
  const FairShare& shares() const { return state_.sharing.order; }
  const HeldThreads& held_threads() const { return state_.sharing.held_threads; }

  // Checks that a new job may depend on the jobs that it names. Errors: kInvalidArgument,
  // kNotFound, kFailedPrecondition.
  absl::Status CheckDependencies(const JobSpec& spec) const {
    return scheduling::CheckDependencies(state_, spec);
  }
  // Removes all dependencies of the job.
  void Release(uint64_t job_id) { scheduling::Release(state_, job_id); }
  // A delivered job is about to be removed: no job waits for it any longer. Before RemoveJob.
  void NoteRemoved(uint64_t job_id) { scheduling::NoteRemoved(state_, job_id); }
  // Whether a live job waits for this one.
  bool IsAwaited(uint64_t job_id) const { return scheduling::IsAwaited(state_, job_id); }
  // The worker, known or not, finishes its leases and gets none until Undrain. then_exit: it is
  // then told to exit. The owner removes drains of workers that do not return.
  void Drain(const std::string& worker_id, bool then_exit) {
    state_.workers.Drain(worker_id, then_exit);
  }
  void Undrain(const std::string& worker_id) { state_.workers.Undrain(worker_id); }

  // Maps manifest digests to reasons (for WaitingReason). No frame of these scenes is leased while
  // they are listed. Replaces the previous map.
  void HoldScenes(std::map<std::string, std::string> reasons) {
    state_.held_scenes = std::move(reasons);
  }
  const std::map<std::string, std::string>& held_scenes() const { return state_.held_scenes; }

  // Jobs that the scheduler itself ended since the last call, for the owner to store.
  std::vector<uint64_t> TakeEndedJobs();
  // Jobs with new failures since the last call, for the owner to store; dates them with `stamp`.
  std::set<uint64_t> TakeFailureJobs(absl::Time stamp) {
    return scheduling::TakeFailureJobs(state_, stamp);
  }
  // Quarantines that began since the last call, for the owner to store; dates them with `stamp`.
  std::vector<QuarantineRecord> TakeQuarantines(absl::Time stamp) {
    return scheduling::TakeQuarantines(state_, stamp);
  }
  // Explains why a live job makes no progress; empty if it does or may, or if it is paused.
  std::string WaitingReason(const JobRecord& job) const {
    return scheduling::WaitingReason(state_, job);
  }

  const std::map<uint64_t, JobRecord>& jobs() const { return state_.jobs; }
  const FrameRecord* FindFrame(const FrameId& id) const {
    return scheduling::FindFrame(state_, id);
  }
  const WorkerTable& workers() const { return state_.workers; }
  const LeaseTable& leases() const { return state_.leases; }
  Counters& counters() { return state_.counters; }
  const Counters& counters() const { return state_.counters; }

 private:
  WorkState state_;
};

}  // namespace sheaf::coordinator
