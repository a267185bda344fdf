// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Farm: the coordinator without its transports, as one object. It joins the scheduler (which worker
// renders which task), the store (durable state) and the merges (parts becoming images), and adds
// locks, the clock and one background thread. Its parts:
//
//     FarmTables       the scheduler and the tables that change with it, under one mutex
//     JobLifecycle     creates, controls, continues, corrects, ends and removes jobs
//     ResultIntake     takes results: check, file, row, scheduler, merge, acknowledgement; gives
//                      guiding fields to workers
//     FrameRounds      advances frames from one round to the next
//     FrameDelivery    the background thread's work: previews, rounds' ends, delivery
//     WorkerDrains     drains workers
//     DiskKeeper       removes items that are no longer kept
//     Scrubber         compares stored data with its digests, in a thread of its own
//     ShareControl     weights and limits of users, shows and pools
//     DeliveredImages, FramePreviews, JobViews, WorkerViews, TaskReports, RefinementPricing,
//     FarmMetrics      answer queries
//
// When a frame's last result is merged, the background thread develops the frame, writes the EXR,
// and records the delivery.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "common/base/steady_time.h"
#include "common/content/blob_store.h"
#include "coordinator/core/frame/check_choice.h"
#include "coordinator/core/frame/lease_token.h"
#include "coordinator/core/job/job_verbs.h"
#include "coordinator/service/farm/delivery/delivered_images.h"
#include "coordinator/service/farm/delivery/frame_delivery.h"
#include "coordinator/service/farm/delivery/frame_rounds.h"
#include "coordinator/service/farm/delivery/tile_builder.h"
#include "coordinator/service/farm/intake/content_exchange.h"
#include "coordinator/service/farm/intake/result_intake.h"
#include "coordinator/service/farm/jobs/job_lifecycle.h"
#include "coordinator/service/farm/queries/farm_metrics.h"
#include "coordinator/service/farm/queries/frame_previews.h"
#include "coordinator/service/farm/queries/job_views.h"
#include "coordinator/service/farm/queries/refinement_pricing.h"
#include "coordinator/service/farm/queries/task_reports.h"
#include "coordinator/service/farm/queries/worker_views.h"
#include "coordinator/service/farm/state/delivery_queue.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_options.h"
#include "coordinator/service/farm/state/farm_signals.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/farm/state/job_journal.h"
#include "coordinator/service/farm/state/part_removals.h"
#include "coordinator/service/farm/state/resumed_frames.h"
#include "coordinator/service/farm/upkeep/disk_keeper.h"
#include "coordinator/service/farm/upkeep/lost_scenes.h"
#include "coordinator/service/farm/upkeep/scrubber.h"
#include "coordinator/service/farm/upkeep/share_control.h"
#include "coordinator/service/farm/upkeep/worker_drains.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/service/view/pixel_view.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/round_previews.h"

namespace sheaf::coordinator {

// A lease with the data of its frame that the worker needs.
struct LeaseGrant {
  Lease lease;
  std::string frame_digest;
  BlobDigest scene;
  FrameSettings settings;
  std::string token;  // LeaseTokens::Make.
};

// Thread safety: all members may be called from any thread.
class Farm : public FarmView {
 public:
  // Loads the state and starts the background thread.
  // Errors: those of SqlJobStore::Open, BlobStore::Open and RoundPreviews::Open.
  static absl::StatusOr<std::unique_ptr<Farm>> Open(const FarmOptions& options);
  // The same with a store of another kind.
  static absl::StatusOr<std::unique_ptr<Farm>> Open(const FarmOptions& options,
                                                    std::unique_ptr<JobStore> store);
  // The same without the background thread: the caller does its work by RunOnce. For
  // single-threaded simulations.
  static absl::StatusOr<std::unique_ptr<Farm>> OpenWithoutThread(const FarmOptions& options,
                                                                 std::unique_ptr<JobStore> store);
  ~Farm() override;

  // The work of the background thread at each wake-up. One thread at a time.
  void RunOnce();

  BlobStore& blobs() { return *blobs_; }
  ContentExchange& content() { return content_; }
  const FarmOptions& options() const { return options_; }
  // For simulations, which check that the tables are consistent.
  FarmTables& tables() { return tables_; }

  // As JobControl::Create.
  absl::StatusOr<uint64_t> CreateJob(JobSpec spec, const std::string& request_id) {
    return lifecycle_.Create(std::move(spec), request_id);
  }
  // Changes a job. OK means: the change is durable. Errors: those of the verb's function in
  // jobs/; kInvalidArgument for arguments out of range.
  absl::Status ChangeJob(JobVerb verb, uint64_t job_id, const JobArguments& arguments);
  // The same by the names of verbs: PauseJob(job_id).
#define SHEAF_VERB(call, word, takes)                                      \
  absl::Status call(uint64_t job_id, const JobArguments& arguments = {}) { \
    return ChangeJob(JobVerb::k##call, job_id, arguments);                 \
  }
  SHEAF_JOB_VERBS(SHEAF_VERB)
#undef SHEAF_VERB

  // Errors: those of WorkerDrains.
  absl::StatusOr<std::vector<std::string>> DrainWorkers(const ChosenWorkers& chosen,
                                                        bool then_exit) {
    return drains_.Drain(chosen, then_exit);
  }
  absl::StatusOr<std::vector<std::string>> UndrainWorkers(const ChosenWorkers& chosen) {
    return drains_.Undrain(chosen);
  }

  // Removes the items that the limits of retention select, and returns them. dry_run: only returns
  // them.
  // Errors: those of the store.
  absl::StatusOr<std::vector<RemovalView>> CollectGarbage(bool dry_run) {
    return keeper_.CollectForPeople(dry_run, keeper_.AgingNow());
  }

  // The usage of jobs and the bytes kept of them, for the query's owner or for all. Errors:
  // kInvalidArgument (too many rows); those of the store.
  absl::StatusOr<UsageReport> ListUsage(const UsageQuery& query);
  // An owner has uploaded bytes of a file.
  void NoteUpload(const std::string& owner, const BlobDigest& blob, uint64_t bytes);
  // Checks that the owner may store `more` bytes; with 0, that they may start jobs. Errors: those
  // of DiskKeeper::CheckOwner.
  absl::Status CheckOwnerBytes(const std::string& owner, uint64_t more) {
    return keeper_.CheckOwner(owner, more);
  }
  // Claims the disk space of an upload, before its first byte. blob: its SHA-256, or empty for
  // several blobs. Errors: those of DiskKeeper::ClaimUpload.
  absl::StatusOr<UploadClaim> ClaimUpload(const std::string& blob, uint64_t bytes) {
    return keeper_.ClaimUpload(blob, bytes, absl::Now());
  }

  struct SynchronizeAnswer {
    std::vector<LeaseGrant> leases;
    absl::Duration next_synchronize;
    absl::Duration lease_duration;
    bool exits = false;           // As in Scheduler.
    bool direct_uploads = false;  // Workers store results themselves, by tickets.
  };
  // Errors: those of Scheduler::Synchronize.
  absl::StatusOr<SynchronizeAnswer> Synchronize(WorkerReport report);

  // OK means: the outcome is durable.
  // Errors: those of ResultIntake::Add.
  absl::StatusOr<ResultOutcome> AddResult(const ResultReport& report, const std::string& bytes) {
    return intake_.Add(report, bytes);
  }
  // Errors: those of ResultIntake::AddStored and TicketFor.
  absl::StatusOr<ResultOutcome> AddStoredResult(const ResultReport& report) {
    return intake_.AddStored(report);
  }
  absl::StatusOr<std::optional<PutTicket>> TicketFor(const ResultReport& report) {
    return intake_.TicketFor(report);
  }

  // Errors: those of ResultIntake::ReadField.
  absl::StatusOr<std::string> ReadGuidingField(const FrameId& id, const BlobDigest& digest) {
    return intake_.ReadField(id, digest);
  }

  // Errors: those of TaskReports::Find.
  absl::StatusOr<TaskReport> FindTask(uint64_t job_id, std::optional<int32_t> frame,
                                      std::optional<uint32_t> task) const {
    return task_reports_.Find(job_id, frame, task);
  }
  // The bytes of a guiding field that a TaskReport names. Errors: those of JobStore::ReadPart.
  absl::StatusOr<std::string> ReadPart(const PartRow& row) { return store_->ReadPart(row); }

  // As JobControl has it.
  absl::Status LiftQuarantine(const std::string& identity) {
    return lifecycle_.LiftQuarantine(identity);
  }

  // Weights and limits of users, shows and pools.
  ShareControl& share_control() { return share_control_; }

  // Errors: those of FramePreviews::ReadPixel.
  absl::StatusOr<PixelView> ReadPixel(const std::string& job_id, int32_t frame_number, int32_t x_px,
                                      int32_t y_px) const {
    return previews_.ReadPixel(job_id, frame_number, x_px, y_px);
  }

  // Path of a delivered EXR. Errors: kNotFound, kFailedPrecondition (not delivered yet, or damaged
  // on disk and being made again).
  absl::StatusOr<std::string> FindOutput(uint64_t job_id, int32_t frame_number) const {
    return images_.Find(job_id, frame_number);
  }

  // FarmView.
  std::vector<JobView> ListJobs() const override { return job_views_.List(); }
  // The same with pilots.
  std::vector<JobView> ListJobsAndPilots() const { return job_views_.ListWithPilots(); }
  // As JobControl has it.
  void NotePilotRequest(uint64_t job_id) { lifecycle_.NotePilotRequest(job_id); }
  absl::StatusOr<JobView> FindJob(const std::string& job_id) const override {
    return job_views_.Find(job_id, /*with_frames=*/true);
  }
  // As in ListJobs: without its frames. Errors: kNotFound.
  absl::StatusOr<JobView> FindJobChanges(const std::string& job_id,
                                         FrameMarks* marks) const override {
    return job_views_.FindChanges(job_id, marks);
  }
  // Whether the job exists and has not ended. Cheap.
  bool IsLive(const std::string& job_id) const { return job_views_.IsLive(job_id); }
  absl::StatusOr<JobView> FindJobAlone(const std::string& job_id) const {
    return job_views_.Find(job_id, /*with_frames=*/false);
  }
  absl::StatusOr<std::vector<FailureView>> ListFailures(const std::string& job_id) const override {
    return worker_views_.ListFailures(job_id);
  }
  absl::StatusOr<std::vector<JobEvent>> ListEvents(const std::string& job_id) const override {
    return worker_views_.ListEvents(job_id);
  }
  absl::StatusOr<RefinementPrices> PriceRefinement(
      const std::string& job_id, const std::vector<double>& target_errors) const override {
    return pricing_.Price(job_id, target_errors);
  }
  std::vector<WorkerView> ListWorkers() const override { return worker_views_.List(); }
  std::vector<MetricView> Metrics() const override;
  absl::StatusOr<PreviewView> Preview(const std::string& job_id, int32_t frame_number,
                                      const std::vector<std::string>& channels) const override {
    return previews_.Preview(job_id, frame_number, channels);
  }
  absl::StatusOr<PreviewView> Thumbnail(const std::string& job_id,
                                        int32_t frame_number) const override {
    return previews_.Thumbnail(job_id, frame_number);
  }
  absl::StatusOr<PreviewView> RoundPreview(const std::string& job_id, int32_t frame_number,
                                           int32_t round) const override {
    return previews_.RoundPreview(job_id, frame_number, round);
  }
  // Whether the disk takes writes.
  absl::Status Ready() const { return disk_.Last(); }
  std::vector<ReadyCondition> Conditions() const override {
    return {{"database", disk_.Last()}, {"disk", keeper_.CheckFreeSpace()}};
  }
  uint64_t ChangeCount() const override { return signals_.ChangeCount(); }
  uint64_t WaitForChange(uint64_t seen, absl::Duration timeout) const override {
    return signals_.WaitForChange(seen, timeout);
  }
  // Grows whenever a job has ended.
  uint64_t EndCount() const { return signals_.EndCount(); }
  // As WaitForChange, of EndCount.
  void WaitForEnd(uint64_t seen, absl::Duration timeout) const {
    signals_.WaitForEnd(seen, timeout);
  }

 private:
  Farm(const FarmOptions& options, std::unique_ptr<JobStore> store,
       std::unique_ptr<BlobStore> blobs, std::unique_ptr<RoundPreviews> round_previews,
       const std::string& secret);
  // Removes the results of identities found to make false ones, and those of lost fields. Whether
  // the disk takes writes again.
  absl::Status ProbeDisk();
  void RemoveFalseResults();
  // Writes pending accounts; logs errors.
  void WriteUsage();
  // Adds what a user did to the job's events.
  void NoteVerb(JobVerb verb, uint64_t job_id, const JobArguments& arguments);
  // Removes failures without proof that the lease was the sender's.
  void KeepProvenFailures(WorkerReport* report) ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);

  const FarmOptions options_;
  const std::unique_ptr<JobStore> store_;
  const std::unique_ptr<BlobStore> blobs_;
  ContentExchange content_;
  const std::unique_ptr<RoundPreviews> round_previews_;
  const LeaseTokens tokens_;
  const CheckChoice choice_;
  FarmTables tables_;
  FarmSignals signals_;
  DiskReserve reserve_;
  DiskState disk_;
  PartRemovals removals_;
  DeliveryQueue queue_;
  ResumedFrames resumed_;
  JobJournal journal_;
  JobContext job_context_;
  JobLifecycle lifecycle_;
  WorkerDrains drains_;
  TileBuilder tiles_;
  FrameRounds rounds_;
  DeliveredImages images_;
  ResultIntake intake_;
  // Only used by RunOnce.
  FrameDelivery delivery_;
  LostScenes lost_scenes_;
  ShareControl share_control_;
  DiskKeeper keeper_;
  SteadyTime next_delivery_ = SteadyTime::InfinitePast();
  SteadyTime next_reserve_look_ = SteadyTime::InfinitePast();
  SteadyTime next_usage_write_ = SteadyTime::InfinitePast();

  FramePreviews previews_;
  JobViews job_views_;
  WorkerViews worker_views_;
  TaskReports task_reports_;
  RefinementPricing pricing_;
  FarmMetrics metrics_;
  std::unique_ptr<Scrubber> scrubber_;  // Null if nothing is scrubbed.
  // Last: they use everything above.
  std::thread background_;
  std::jthread scrubbing_;
};

}  // namespace sheaf::coordinator
