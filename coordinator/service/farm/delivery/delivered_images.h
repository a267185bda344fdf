// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DeliveredImages: the EXR files of delivered frames and their thumbnails. A file that was altered
// or removed on disk is detected when it is requested, and made again: from the frame's parts,
// after rendering those that are missing.
#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/content/verified_files.h"
#include "common/film/film.h"
#include "coordinator/service/farm/jobs/job_continuation.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class DeliveredImages {
 public:
  // Both pointers must outlive the object.
  DeliveredImages(std::string state_directory, FarmTables* tables, JobStore* store)
      : state_directory_(std::move(state_directory)), tables_(*tables), store_(*store) {}

  // Path of a delivered EXR. Errors: kNotFound; kFailedPrecondition (not delivered yet, or damaged
  // on disk and being made again).
  absl::StatusOr<std::string> Find(uint64_t job_id, int32_t frame_number) const;
  // The same for a frame that is known to be delivered.
  absl::StatusOr<std::string> FindDelivered(const FrameId& id) const;
  // Reads and verifies the EXR of a delivered frame, even if it was verified before. Returns its
  // size.
  // Errors: kFailedPrecondition (damaged on disk, and being made again); kNotFound.
  absl::StatusOr<uint64_t> Verify(const FrameId& id) const;
  // Writes the EXR and the thumbnail of a frame that is about to be delivered. A thumbnail that
  // cannot be written is skipped. Errors: those of WriteFrameImage.
  absl::Status Write(const FrameId& id, const FrameImage& image);
  absl::StatusOr<std::string> ThumbnailPath(const FrameId& id) const;

  // Starts to remake damaged images of jobs that have succeeded.
  void Heal(JobContinuation* jobs);
  // The number of damaged images found so far.
  uint64_t DamagedCount() const;

 private:
  // Checks that the file is the delivered image; otherwise starts to remake it. Errors:
  // kFailedPrecondition.
  absl::Status Check(const FrameId& id, const std::string& path) const;
  void KeepThumbnail(const FrameId& id, const FrameImage& image) const;

  const std::string state_directory_;
  FarmTables& tables_;
  JobStore& store_;
  mutable VerifiedFiles verified_;  // By path.
  mutable Mutex mutex_;             // Taken after the tables' mutex if both are held.
  mutable std::set<FrameId> damaged_ ABSL_GUARDED_BY(mutex_);  // To be made again.
  mutable uint64_t damaged_count_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace sheaf::coordinator
