// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RoundPreviews: small copies of a frame's image at the end of each round, so that users can review
// the progress. Stored in a folder:
//
//     DIR/JOB/FRAME/ROUND.exr     R, G, B, stderr.{R,G,B} and samples
//
// Rendering does not depend on them: lost previews are not restored, and beyond the limits the
// oldest are removed.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/film/frame_image.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

struct RoundPreviewLimits {
  int64_t pixels_max = int64_t{1} << 17;  // Pixels of one preview.
  size_t rounds_max = 24;  // Rounds of a frame; beyond the limit every other one is removed.
  uint64_t bytes_max = uint64_t{2} << 30;  // All previews together; 0: none are kept.
};

// Thread safety: all members may be called concurrently.
class RoundPreviews {
 public:
  // Finds the previews of earlier runs. Creates the directory if it does not exist.
  static absl::StatusOr<std::unique_ptr<RoundPreviews>> Open(const std::string& directory,
                                                             const RoundPreviewLimits& limits);

  // Stores a copy of the image, replacing one of the same round. Errors: those of the disk; the
  // preview is then not stored.
  absl::Status Keep(const FrameId& frame, int32_t round, const FrameImage& image);
  // Increases with each Keep of this run; 0 if there is no preview.
  uint64_t VersionOf(const FrameId& frame, int32_t round) const;
  // Errors: kNotFound (no preview), those of ReadFrameImage.
  absl::StatusOr<FrameImage> Read(const FrameId& frame, int32_t round) const;
  // Removes the previews of a frame from this round on.
  void RemoveFrom(const FrameId& frame, int32_t round);

  // Bytes of previews, by job; only jobs with previews.
  std::map<uint64_t, uint64_t> BytesByJob() const;
  void RemoveJob(uint64_t job_id);

 private:
  struct Entry {
    uint64_t version = 0;
    uint64_t size_bytes = 0;
  };
  using Name = std::pair<FrameId, int32_t>;  // Frame and round.

  RoundPreviews(std::string directory, const RoundPreviewLimits& limits)
      : directory_(std::move(directory)), limits_(limits) {}
  void Scan();
  std::string FolderOf(const FrameId& frame) const;
  std::string PathOf(const Name& name) const;
  void Add(const Name& name, uint64_t size_bytes) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Remove(const Name& name) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void ThinOut(const FrameId& frame) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::set<int32_t> RoundsOf(const FrameId& frame) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::string directory_;
  const RoundPreviewLimits limits_;
  mutable Mutex mutex_;
  std::map<Name, Entry> entries_ ABSL_GUARDED_BY(mutex_);
  std::map<uint64_t, Name> by_version_ ABSL_GUARDED_BY(mutex_);  // Oldest first.
  uint64_t size_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t last_version_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace sheaf::coordinator
