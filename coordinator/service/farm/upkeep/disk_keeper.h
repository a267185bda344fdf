// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DiskKeeper: keeps the state directory within its limits. It lists the stored items, lets
// DecideRemovals (coordinator/core/policy/retention.h) choose, and removes the chosen ones. Each
// removal is checked again under the locks of its owner, so an item that a job has come to need
// since it was listed stays.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "common/content/blob_store.h"
#include "coordinator/core/policy/aging_clock.h"
#include "coordinator/core/policy/owner_bytes.h"
#include "coordinator/core/policy/retention.h"
#include "coordinator/service/farm/jobs/job_removal.h"
#include "coordinator/service/farm/state/farm_options.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/farm/upkeep/upload_claims.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/store/disk_reserve.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/round_previews.h"

namespace sheaf::coordinator {

// Minimum interval of listing users' stored bytes; uploads since then count at once.
inline constexpr absl::Duration kOwnerBytesInterval = absl::Seconds(10);
// Files whose uploader is remembered. Beyond the limit all are forgotten: files that no job needs
// then have no owner until they are removed, a day later.
inline constexpr size_t kUploadersRememberedMax = 100'000;

// Thread safety: all members may be called concurrently, except Update: one thread at a time.
class DiskKeeper {
 public:
  // The objects that it works on; all must outlive it.
  struct Parts {
    FarmTables& tables;
    JobStore& store;
    const BlobStore& blobs;
    RoundPreviews& previews;
    JobRemoval& jobs;
    DiskReserve& reserve;
  };
  DiskKeeper(const FarmOptions& options, const Parts& parts);

  // Removes the items that the limits select. Cheap if nothing is due.
  void Update();
  // The time by which items age, for Collect. Warns when the wall clock has been set ahead.
  absl::Time AgingNow();
  // Returns the items that the limits remove now; removes them unless dry_run. Errors: those
  // of the store.
  absl::StatusOr<std::vector<Removal>> Collect(bool dry_run, absl::Time now);

  // The same now, with blobs and uploads together, by reason.
  absl::StatusOr<std::vector<RemovalView>> CollectForPeople(bool dry_run);

  void AddMetrics(std::vector<MetricView>* metrics) const;

  // Records the uploader of a blob that no job references yet. These are in owner_storage.cc.
  void NoteUpload(const std::string& owner, const BlobDigest& blob, uint64_t bytes);
  // The stored bytes of each user, up to kOwnerBytesInterval old. Errors: those of the store.
  absl::StatusOr<std::map<std::string, OwnerBytes>> BytesByOwner();
  // Checks that the owner may add more bytes (CheckOwnerBytes). Concurrent calls of one owner may
  // exceed the limit by the bytes that they add. Errors: kResourceExhausted; those of the store.
  absl::Status CheckOwner(const std::string& owner, uint64_t more);
  // Checks that the file system has its minimum of free space. Errors: kResourceExhausted.
  absl::Status CheckFreeSpace() const;
  // Claims disk space for the bytes of an upload, in addition to the minimum of free space, the
  // database's reserve and other claims. Makes room if that suffices. blob: its SHA-256, or empty
  // for several. Errors: kResourceExhausted.
  absl::StatusOr<UploadClaim> ClaimUpload(const std::string& blob, uint64_t bytes,
                                          absl::Time now = absl::Now());

 private:
  struct Stored {
    std::vector<KeptItem> items;
    DiskUse use;
    uint64_t reopen_count = 0;  // JobRemoval's, before anything was listed.
  };
  // Lists the jobs, and the blobs that they name.
  struct JobUse {
    bool in_use = false;
    bool is_recent = false;  // It ended less than RetentionLimits::job_age_min ago.
    absl::Time end_time;
    std::vector<BlobDigest> scenes;  // Manifests.
    std::vector<BlobDigest> images;  // Images that frames resume.
    std::string owner;
  };
  struct BlobUse {
    bool in_use = false;
    absl::Time end_time = absl::InfinitePast();  // The last of its jobs'.
  };

  absl::StatusOr<Stored> List(absl::Time now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::map<uint64_t, JobUse> ListJobs() const;
  void ListBlobs(const std::map<uint64_t, JobUse>& jobs, absl::Time now,
                 std::vector<KeptItem>* items) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The files of a scene. Errors: its manifest cannot be read.
  absl::StatusOr<std::vector<std::string>> FilesOf(const BlobDigest& scene)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<std::map<std::string, OwnerBytes>> ListBytesByOwner(
      const std::map<std::string, std::string>& uploaders) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  uint64_t OutputBytes(uint64_t job_id) const;
  DiskUse Measure() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The bytes of the file system available to uploads.
  uint64_t UploadRoom() const;
  // Removes removable items if that makes room for this many more bytes.
  void MakeUploadRoom(uint64_t bytes, absl::Time now);
  // Returns whether it is removed.
  bool Remove(const KeptItem& item, absl::Time now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Removes the items. Returns those that are removed.
  std::vector<Removal> RemoveAll(const std::vector<Removal>& removals, uint64_t reopen_count,
                                 absl::Time now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Duration AgeInterval() const;
  void NoteOver(const DiskUse& use) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::string state_directory_;
  const RetentionLimits limits_;
  const uint64_t owner_bytes_max_;
  const std::string space_advice_;
  FarmTables& tables_;
  JobStore& store_;
  const BlobStore& blobs_;
  RoundPreviews& previews_;
  JobRemoval& jobs_;
  DiskReserve& reserve_;
  UploadClaims claims_;

  const AgingClock aging_;
  std::atomic<bool> is_ahead_ = false;  // Whether the wall clock was, at the last check.

  mutable Mutex mutex_;  // Held by one pass at a time. Taken before that of JobContext.
  // Files by scene, as read from manifests, of the scenes that jobs name.
  std::map<std::string, std::vector<std::string>> files_ ABSL_GUARDED_BY(mutex_);
  uint64_t other_bytes_ ABSL_GUARDED_BY(mutex_) = 0;  // Without parts, as last walked.
  SteadyTime next_walk_ ABSL_GUARDED_BY(mutex_) = SteadyTime::InfinitePast();
  bool is_over_ ABSL_GUARDED_BY(mutex_) = false;  // With nothing left to remove.
  std::map<std::string, OwnerBytes> owner_bytes_ ABSL_GUARDED_BY(mutex_);
  SteadyTime next_owner_bytes_ ABSL_GUARDED_BY(mutex_) = SteadyTime::InfinitePast();
  Mutex uploads_mutex_ ABSL_ACQUIRED_AFTER(mutex_);
  std::map<std::string, std::string> uploaders_ ABSL_GUARDED_BY(uploads_mutex_);    // By blob.
  std::map<std::string, uint64_t> uploaded_since_ ABSL_GUARDED_BY(uploads_mutex_);  // By owner.
  // Only used by Update.
  SteadyTime next_look_ = SteadyTime::InfinitePast(), next_age_pass_;

  mutable Mutex counts_mutex_;
  struct Counts {
    uint64_t removed = 0, bytes = 0;
  };
  std::array<Counts, kKeptKindCount> counts_ ABSL_GUARDED_BY(counts_mutex_);
  uint64_t state_bytes_ ABSL_GUARDED_BY(counts_mutex_) = 0;  // As last measured.
};

}  // namespace sheaf::coordinator
