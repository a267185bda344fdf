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
//     FarmMetrics      answer queries; FarmQueries joins them
//
// Its own functions are those that concern several parts; for the others, callers take the part.
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
#include "coordinator/service/farm/farm_queries.h"
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
class Farm {
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
  ~Farm();

  // The work of the background thread at each wake-up. One thread at a time.
  void RunOnce();

  // The parts, which have their contracts.
  const FarmView& view() const { return view_; }
  ResultIntake& intake() { return intake_; }
  BlobStore& blobs() { return *blobs_; }
  ContentExchange& content() { return content_; }
  DiskKeeper& keeper() { return keeper_; }
  WorkerDrains& drains() { return drains_; }
  ShareControl& share_control() { return share_control_; }
  const JobViews& job_views() const { return job_views_; }
  const FramePreviews& previews() const { return previews_; }
  const DeliveredImages& images() const { return images_; }
  const FarmMetrics& metrics() const { return metrics_; }
  const TaskReports& task_reports() const { return task_reports_; }
  const FarmSignals& signals() const { return signals_; }
  const DiskState& disk() const { return disk_; }
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

  // The usage of jobs and the bytes kept of them, for the query's owner or for all. Errors:
  // kInvalidArgument (too many rows); those of the store.
  absl::StatusOr<UsageReport> ListUsage(const UsageQuery& query);
  // An owner has uploaded bytes of a file.
  void NoteUpload(const std::string& owner, const BlobDigest& blob, uint64_t bytes);
  struct SynchronizeAnswer {
    std::vector<LeaseGrant> leases;
    absl::Duration next_synchronize;
    absl::Duration lease_duration;
    bool exits = false;           // As in Scheduler.
    bool direct_uploads = false;  // Workers store results themselves, by tickets.
  };
  // Errors: those of Scheduler::Synchronize.
  absl::StatusOr<SynchronizeAnswer> Synchronize(WorkerReport report);

  // As JobControl has them. The other functions of jobs are verbs.
  absl::Status LiftQuarantine(const std::string& identity) {
    return lifecycle_.LiftQuarantine(identity);
  }
  void NotePilotRequest(uint64_t job_id) { lifecycle_.NotePilotRequest(job_id); }

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
  FarmQueries view_;
  // Last: they use everything above.
  std::thread background_;
  std::jthread scrubbing_;
};

}  // namespace sheaf::coordinator
