// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Retention: which of the stored things go, why, and in which order, so that the coordinator's disk
// does not fill. A pure function: what is stored, the limits and the time are arguments. Nothing
// that a job needs which has not ended, or which is pinned, ever goes
// ([ADR 68](docs/adr/0068-a-disk-that-does-not-fill.md)).
#pragma once

#include <cstdint>
#include <vector>

#include "absl/time/time.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// In the order in which they go where space is short: what costs least to lose goes first.
enum class KeptKind {
  kUpload,    // An upload without a writer: its sender begins it anew.
  kParts,     // All parts of an ended job: it is refined from its image then.
  kBlob,      // A file of a scene: submitting the scene again brings it back.
  kPreviews,  // The images of the ends of a job's rounds.
  kJob,       // The job's rows, its delivered images and thumbnails.
};
inline constexpr int kKeptKindCount = 5;
// Returns "upload", "parts", "blob", "previews" or "job".
const char* KeptKindName(KeptKind kind);

struct KeptItem {
  KeptKind kind = KeptKind::kParts;
  uint64_t job_id = 0;   // 0: of a blob or an upload.
  BlobDigest blob = {};  // For blobs alone.
  uint64_t size_bytes = 0;
  // When the job ended; of a blob, when the last of its jobs ended or somebody last asked for it.
  absl::Time unused_since = absl::InfinitePast();
  bool in_use = false;   // A job needs it that has not ended, or is pinned.
  bool is_named = true;  // For a blob: whether any job names it.
};

struct RetentionLimits {
  // After a job's end.
  absl::Duration parts_age_max = absl::Hours(7 * 24);
  absl::Duration jobs_age_max = absl::InfiniteDuration();  // Previews and images, too.
  // For blobs that no job names, and for uploads that nobody goes on with.
  absl::Duration unnamed_age_max = absl::Hours(24);
  // Clients ask which blobs are there, and submit afterwards: no blob goes earlier than this. An
  // upload goes at any time: no client has been told that its blob is there.
  absl::Duration blob_age_min = absl::Hours(1);
  // A job is not removed this soon after its end: somebody may still be working on it.
  absl::Duration job_age_min = absl::Minutes(10);
  // Bytes below the state directory. Jobs go by this limit, too.
  uint64_t bytes_max = UINT64_MAX;
  // Free bytes of its file system, at most kFreeFractionMax of the whole. Jobs do not go by it:
  // others may be filling the disk.
  uint64_t free_bytes_min = uint64_t{1} << 30;
};
// A small file system is not kept empty by the default.
inline constexpr uint64_t kFreeFractionMax = 20;  // 1 / 20.
// Above its limit, the directory is brought this fraction below it, so that not every result makes
// something go.
inline constexpr uint64_t kRoomFraction = 20;  // 1 / 20.

struct DiskUse {
  uint64_t bytes = 0;                // Below the state directory.
  uint64_t free_bytes = UINT64_MAX;  // In the file system; UINT64_MAX: unknown.
  uint64_t capacity_bytes = 0;
  uint64_t claimed_bytes = 0;  // Of the free ones, by what is about to be written.
};

enum class RemovalReason { kAge, kUnnamed, kLimit, kFreeSpace };
// "it is older than its limit" and the like.
const char* RemovalReasonText(RemovalReason reason);

struct Removal {
  KeptItem item;
  RemovalReason reason = RemovalReason::kAge;
};

// The bytes that must go: by the limit of the directory, and by that of the free space.
struct BytesOver {
  uint64_t limit = 0, free_space = 0;
};
BytesOver BytesOverOf(const DiskUse& use, const RetentionLimits& limits);

// Returns the things that go, in this order: first the ones that are too old; then, while space is
// short, kind by kind (as KeptKind has them) the ones that have been unused longest. Things of no
// bytes go by their age alone.
std::vector<Removal> DecideRemovals(std::vector<KeptItem> items, const DiskUse& use,
                                    const RetentionLimits& limits, absl::Time now);

}  // namespace sheaf::coordinator
