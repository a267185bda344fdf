// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Retention: the stored items to remove, with reasons and in order, so that the coordinator's disk
// does not fill. A pure function: the items, the limits and the time are arguments. Items that an
// unfinished or pinned job needs are never removed ([ADR
// 68](docs/adr/0068-a-disk-that-does-not-fill.md)).
#pragma once

#include <cstdint>
#include <vector>

#include "absl/time/time.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// In order of removal while space is short: the cheapest to lose first.
enum class KeptKind {
  kUpload,    // An upload without a writer: its sender restarts it.
  kParts,     // All parts of an ended job: a refinement then starts from its image.
  kBlob,      // A file of a scene: submitting the scene again brings it back.
  kPreviews,  // The images of the ends of a job's rounds.
  kJob,       // The job's rows, its delivered images and thumbnails.
};
inline constexpr int kKeptKindCount = 5;
// Returns "upload", "parts", "blob", "previews" or "job".
const char* KeptKindName(KeptKind kind);

struct KeptItem {
  KeptKind kind = KeptKind::kParts;
  uint64_t job_id = 0;   // 0: a blob or an upload.
  BlobDigest blob = {};  // Only for blobs.
  uint64_t size_bytes = 0;
  // When the job ended. For a blob: when the last of its jobs ended, or when it was last requested.
  absl::Time unused_since = absl::InfinitePast();
  bool in_use = false;   // An unfinished or pinned job needs it.
  bool is_named = true;  // For a blob: whether any job names it.
};

struct RetentionLimits {
  // Time since a job's end.
  absl::Duration parts_age_max = absl::Hours(7 * 24);
  absl::Duration jobs_age_max = absl::InfiniteDuration();  // Previews and images, too.
  // For blobs that no job names, and for abandoned uploads.
  absl::Duration unnamed_age_max = absl::Hours(24);
  // Clients ask which blobs are present before they submit, so no blob is removed earlier than
  // this. An upload may be removed at any time: no client was told that its blob is present.
  absl::Duration blob_age_min = absl::Hours(1);
  // A job is not removed this soon after its end: a user may still be working on it.
  absl::Duration job_age_min = absl::Minutes(10);
  // Bytes below the state directory. This limit also removes jobs.
  uint64_t bytes_max = UINT64_MAX;
  // Free bytes of its file system, at most 1 / kFreeFractionMax of the whole. This limit does not
  // remove jobs: other programs may be filling the disk.
  uint64_t free_bytes_min = uint64_t{1} << 30;
};
// Keeps the default from emptying a small file system.
inline constexpr uint64_t kFreeFractionMax = 20;  // 1 / 20.
// A directory above its limit is brought this fraction below it, so that not every result causes a
// removal.
inline constexpr uint64_t kRoomFraction = 20;  // 1 / 20.

struct DiskUse {
  uint64_t bytes = 0;                // Below the state directory.
  uint64_t free_bytes = UINT64_MAX;  // In the file system; UINT64_MAX: unknown.
  uint64_t capacity_bytes = 0;
  uint64_t claimed_bytes = 0;  // Free bytes reserved for pending writes.
};

enum class RemovalReason { kAge, kUnnamed, kLimit, kFreeSpace };
// "it is older than its limit" and the like.
const char* RemovalReasonText(RemovalReason reason);

struct Removal {
  KeptItem item;
  RemovalReason reason = RemovalReason::kAge;
};

// The bytes to remove: by the directory's limit, and by the free-space limit.
struct BytesOver {
  uint64_t limit = 0, free_space = 0;
};
BytesOver BytesOverOf(const DiskUse& use, const RetentionLimits& limits);

// Returns the removals in order: first items that are too old; then, while space is short, kind by
// kind (in the order of KeptKind) the items unused for longest. Items of no bytes are removed only
// by age.
std::vector<Removal> DecideRemovals(std::vector<KeptItem> items, const DiskUse& use,
                                    const RetentionLimits& limits, absl::Time now);

}  // namespace sheaf::coordinator
