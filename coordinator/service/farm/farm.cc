// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/farm.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/steady_time.h"
#include "coordinator/service/farm/jobs/job_restore.h"
#include "coordinator/store/farm_secret.h"
#include "coordinator/store/sql_job_store.h"

namespace sheaf::coordinator {
namespace {

constexpr absl::Duration kBackgroundInterval = absl::Milliseconds(100);
constexpr absl::Duration kDeliveryRetryInterval = absl::Seconds(5);
constexpr absl::Duration kReserveLookInterval = absl::Seconds(1);

}  // namespace

absl::StatusOr<std::unique_ptr<Farm>> Farm::Open(const FarmOptions& options) {
  absl::StatusOr<std::unique_ptr<SqlJobStore>> store =
      SqlJobStore::Open(options.state_directory, options.durability, options.parts);
  if (!store.ok()) return store.status();
  return Open(options, *std::move(store));
}

absl::StatusOr<std::unique_ptr<Farm>> Farm::Open(const FarmOptions& options,
                                                 std::unique_ptr<JobStore> store) {
  absl::StatusOr<std::unique_ptr<Farm>> farm = OpenWithoutThread(options, std::move(store));
  if (!farm.ok()) return farm;
  (*farm)->background_ = std::thread([f = farm->get()] {
    while (f->queue_.Wait(kBackgroundInterval)) f->RunOnce();
  });
  if (Scrubber* const scrubber = (*farm)->scrubber_.get(); scrubber != nullptr) {
    (*farm)->scrubbing_ =
        std::jthread([scrubber](const std::stop_token& stop) { scrubber->Run(stop); });
  }
  return farm;
}

absl::StatusOr<std::unique_ptr<Farm>> Farm::OpenWithoutThread(const FarmOptions& options,
                                                              std::unique_ptr<JobStore> store) {
  absl::StatusOr<std::unique_ptr<BlobStore>> blobs =
      BlobStore::Open(options.state_directory + "/content", BlobStore::Clock::now, options.content);
  if (!blobs.ok()) return blobs.status();
  absl::StatusOr<std::unique_ptr<RoundPreviews>> round_previews = RoundPreviews::Open(
      options.state_directory + "/rounds", {.bytes_max = options.round_previews_bytes_max});
  if (!round_previews.ok()) return round_previews.status();
  const absl::StatusOr<std::string> secret = LoadOrMakeSecret(options.state_directory);
  if (!secret.ok()) return secret.status();
  std::unique_ptr<Farm> farm(
      new Farm(options, std::move(store), *std::move(blobs), *std::move(round_previews), *secret));
  if (absl::Status status = LoadJobs(farm->job_context_); !status.ok()) return status;
  if (absl::Status status = farm->share_control_.Load(); !status.ok()) return status;
  if (absl::Status status = farm->drains_.Load(); !status.ok()) return status;
  return farm;
}

Farm::Farm(const FarmOptions& options, std::unique_ptr<JobStore> store,
           std::unique_ptr<BlobStore> blobs, std::unique_ptr<RoundPreviews> round_previews,
           const std::string& secret)
    : options_(options),
      store_(std::move(store)),
      blobs_(std::move(blobs)),
      content_(blobs_.get()),
      round_previews_(std::move(round_previews)),
      tokens_(secret),
      choice_(secret),
      tables_(options.limits, store_->FirstLeaseId(), options.merge_bytes_max),
      reserve_(options.state_directory, options.disk_reserve_bytes),
      disk_(&signals_, &reserve_),
      removals_(store_.get(), &disk_),
      resumed_(blobs_.get(), NumericProfile()),
      journal_(store_.get()),
      job_context_{options,  NumericProfile(), tables_, *store_,  removals_, *round_previews_,
                   resumed_, queue_,           disk_,   signals_, journal_},
      lifecycle_(job_context_),
      drains_(options.limits, {tables_, *store_, disk_, signals_}),
      tiles_(&tables_, store_.get(), &resumed_, &removals_),
      rounds_(&tables_, store_.get(), round_previews_.get(), &disk_),
      images_(options.state_directory, &tables_, store_.get()),
      intake_({tokens_, choice_, tables_, *store_, removals_, tiles_, lifecycle_, queue_, disk_,
               signals_}),
      delivery_(options.preview_interval_min, {tables_, *store_, tiles_, rounds_, images_,
                                               lifecycle_, queue_, disk_, signals_, *blobs_}),
      lost_scenes_(&tables_, blobs_.get(), &signals_),
      share_control_(options.limits, {tables_, *store_, disk_, signals_}),
      keeper_(options, {tables_, *store_, *blobs_, *round_previews_, lifecycle_, reserve_}),
      previews_(&tables_, store_.get(), round_previews_.get(), &images_),
      job_views_(options.state_directory, &tables_, round_previews_.get(), &disk_),
      worker_views_(&tables_, blobs_.get(), &journal_),
      task_reports_(&tables_, store_.get()),
      pricing_(&tables_, store_.get()),
      metrics_(options.state_directory, &tables_, store_.get(), &images_, &disk_),
      scrubber_(options.scrub_bytes_per_second == 0
                    ? nullptr
                    : std::make_unique<Scrubber>(options.scrub_bytes_per_second,
                                                 Scrubber::Parts{tables_, *store_, *blobs_, images_,
                                                                 lifecycle_, removals_})),
      view_({job_views_, worker_views_, previews_, pricing_, metrics_, keeper_, content_,
             scrubber_.get(), options_.parts, disk_, signals_}) {}

Farm::~Farm() {
  queue_.Stop();
  scrubbing_.request_stop();
  if (scrubbing_.joinable()) scrubbing_.join();
  if (background_.joinable()) background_.join();
  lifecycle_.SaveFailures();
  journal_.Write();
  WriteUsage();
}

void Farm::RunOnce() {
  if (lifecycle_.Tick()) signals_.Changed();
  if (const SteadyTime now = SteadyTime::Now(); now >= next_reserve_look_) {
    next_reserve_look_ = now + kReserveLookInterval;
    reserve_.Update();
  }
  const bool disk_fine = disk_.Last().ok();
  if (disk_fine || SteadyTime::Now() >= next_delivery_) {
    next_delivery_ = SteadyTime::Now() + kDeliveryRetryInterval;
    lifecycle_.SettleEnded();
    lifecycle_.LimitKeptParts();
    // No other write may happen meanwhile that would detect free space.
    if (!disk_fine) disk_.Note(ProbeDisk());
    removals_.Retry();
    RemoveFalseResults();
    images_.Heal(&lifecycle_);
    delivery_.DeliverFrames();
  }
  if (const SteadyTime now = SteadyTime::Now(); disk_fine && now >= next_usage_write_) {
    next_usage_write_ = now + kUsageWriteInterval;
    WriteUsage();
  }
  if (disk_fine) journal_.Write();
  drains_.ForgetOld();
  keeper_.Update();
  lost_scenes_.Update();
  delivery_.RefreshFrames();
}

absl::Status Farm::ChangeJob(JobVerb verb, uint64_t job_id, const JobArguments& arguments) {
  // These continue frames, whose tasks must not change meanwhile.
  std::optional<ResultIntake::Pause> pause;
  if (verb == JobVerb::kRetryTasks || verb == JobVerb::kApproveFrames) pause.emplace(&intake_);
  absl::Status changed = absl::InternalError("unknown verb");
  switch (verb) {
#define SHEAF_VERB(call, word, takes)             \
  case JobVerb::k##call:                          \
    changed = lifecycle_.call(job_id, arguments); \
    break;
    SHEAF_JOB_VERBS(SHEAF_VERB)
#undef SHEAF_VERB
  }
  if (changed.ok()) NoteVerb(verb, job_id, arguments);
  return changed;
}

void Farm::NoteVerb(JobVerb verb, uint64_t job_id, const JobArguments& arguments) {
  JobEvent event{.job_id = job_id,
                 .what = RowOf(verb).word,
                 .who = arguments.user,
                 .frame_number = arguments.frame};
  if (arguments.task) event.text = absl::StrCat("task ", *arguments.task);
  if (verb == JobVerb::kSetJobPriority) event.text = absl::StrCat(arguments.priority);
  if (!arguments.frames.empty()) {
    event.text = absl::StrCat(arguments.frames.size(), " frames from ", arguments.frames.front());
  }
  journal_.Note(std::move(event));
}

absl::Status Farm::ProbeDisk() {
  const absl::Status room = disk_.CheckRoom(kProbeBytes);
  return room.ok() ? store_->Probe() : room;
}

void Farm::RemoveFalseResults() {
  std::vector<std::string> liars;
  std::set<FrameId> stale_fields;
  {
    const MutexLock lock(&tables_.mutex);
    liars = tables_.liars;
    stale_fields = tables_.stale_fields;
  }
  if (liars.empty() && stale_fields.empty()) return;
  const ResultIntake::Pause pause(&intake_);
  for (const std::string& identity : liars) {
    const absl::Status removed = lifecycle_.RemoveResultsOf(identity);
    if (!removed.ok()) {
      LogError(absl::StrCat("removing the results of ", identity, ": ", removed.message()));
      continue;
    }
    const MutexLock lock(&tables_.mutex);
    tables_.liars.erase(std::find(tables_.liars.begin(), tables_.liars.end(), identity));
  }
  for (const FrameId& id : stale_fields) {
    const absl::Status removed = lifecycle_.RemovePartsOfLostField(id);
    if (!removed.ok()) {
      LogError(absl::StrCat("removing the parts of a lost guiding field: ", removed.message()));
      continue;
    }
    const MutexLock lock(&tables_.mutex);
    tables_.stale_fields.erase(id);
  }
}

void Farm::KeepProvenFailures(WorkerReport* report) {
  const auto lacks_proof =
      [&](const LeaseFailure& failure) ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex) {
        const Lease* lease = tables_.scheduler.leases().Find(failure.lease_id);
        if (lease == nullptr) return true;  // It has ended: ignore its failure.
        const std::string digest =
            tables_.scheduler.FindFrame(lease->frame)->packed.frame_digest().Hex();
        const LeasedWork work{lease->lease_id,   IdentityOf(*report), digest,     lease->tile_rect,
                              lease->task.block, lease->cells,        lease->kind};
        if (tokens_.IsValid(work, failure.token)) return false;
        ++tables_.scheduler.counters().failures_refused;
        LogWarning(absl::StrCat("worker ", report->worker_id, " reports a failure of lease ",
                                failure.lease_id, " without the token that proves it: refused"));
        return true;
      };
  std::erase_if(report->failures, lacks_proof);
}

absl::StatusOr<Farm::SynchronizeAnswer> Farm::Synchronize(WorkerReport report) {
  SynchronizeAnswer answer;
  const std::string worker = absl::StrCat("workers/", report.worker_id);
  {
    const MutexLock lock(&tables_.mutex);
    KeepProvenFailures(&report);
    const SteadyTime now = SteadyTime::Now();
    absl::StatusOr<Scheduler::SynchronizeAnswer> decided =
        tables_.scheduler.Synchronize(report, now);
    tables_.NoteEndedJobs();
    if (!decided.ok()) return decided.status();
    std::set<FrameId> begun;
    for (Lease& lease : decided->leases) {
      const FrameRecord& record = *tables_.scheduler.FindFrame(lease.frame);
      if (record.first_lease_time == now && begun.insert(lease.frame).second) {
        journal_.Note({.job_id = lease.frame.job_id,
                       .what = "started",
                       .who = worker,
                       .frame_number = lease.frame.frame_number});
      }
      FrameSpec frame = record.Spec();
      answer.leases.push_back(
          {std::move(lease), frame.frame_digest, frame.scene, frame.settings, /*token=*/""});
    }
    answer.next_synchronize = decided->next_synchronize;
    answer.exits = decided->exits;
    answer.direct_uploads = options_.parts != nullptr;
    answer.lease_duration = options_.limits.lease_duration;
  }
  for (LeaseGrant& grant : answer.leases) {
    const Lease& lease = grant.lease;
    grant.token = tokens_.Make({lease.lease_id, lease.identity, grant.frame_digest, lease.tile_rect,
                                lease.task.block, lease.cells, lease.kind});
  }
  if (!report.failures.empty()) lifecycle_.SettleEnded();
  signals_.Changed();
  return answer;
}

void Farm::WriteUsage() {
  const absl::Status written = store_->WriteUsage();
  if (!written.ok()) LogWarning(absl::StrCat("writing accounts: ", written.message()));
}

absl::StatusOr<UsageReport> Farm::ListUsage(const UsageQuery& query) {
  UsageReport report;
  const absl::StatusOr<std::vector<UsageRow>> rows = store_->LoadUsage(query);
  if (!rows.ok()) return rows.status();
  absl::StatusOr<std::vector<UsageSum>> sums = SumUsage(*rows, query);
  if (!sums.ok()) return sums.status();
  report.sums = *std::move(sums);
  const absl::StatusOr<std::map<std::string, OwnerBytes>> owners = keeper_.BytesByOwner();
  if (!owners.ok()) return owners.status();
  for (const auto& [owner, bytes] : *owners) {
    if (!query.owner.empty() && owner != query.owner) continue;
    report.stored.push_back({owner, bytes, options_.limits.owner_bytes_max});
  }
  return report;
}

void Farm::NoteUpload(const std::string& owner, const BlobDigest& blob, uint64_t bytes) {
  if (bytes == 0) return;
  keeper_.NoteUpload(owner, blob, bytes);
  store_->NoteUsage({0, owner}, {.upload_bytes = bytes});
}

}  // namespace sheaf::coordinator
