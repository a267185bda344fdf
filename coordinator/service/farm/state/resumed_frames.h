// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ResumedFrames: the images that frames resume (resumed_image.h). An image's samples count as
// done from the start; a tile built from disk is also built from it.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/content/blob_store.h"
#include "common/film/exr/resumed_image.h"
#include "coordinator/core/job/cell_grid.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// By frame: the samples that the image it resumes has in each of its cells.
using ResumedCounts = std::map<int32_t, std::vector<uint64_t>>;

// Thread safety: all members may be called concurrently.
class ResumedFrames {
 public:
  // `blobs` must outlive the object.
  ResumedFrames(const BlobStore* blobs, std::string numeric_profile)
      : blobs_(*blobs), numeric_profile_(std::move(numeric_profile)) {}

  // Errors: kInvalidArgument, kNotFound, kDataLoss: the frame cannot resume its image.
  absl::StatusOr<ResumedImage> Open(const FrameSpec& spec, const CellGrid& grid) const;
  // Counts the samples of those frames that resume images. Errors: those of Open.
  absl::StatusOr<ResumedCounts> Count(const std::vector<FrameSpec>& frames,
                                      const Partition& partition) const;

  // Stores the delivered image at `path` as a blob and makes the frame continue from it. Errors:
  // those of Open and of the disk; the frame is then unchanged.
  absl::Status ContinueFrom(const std::string& path, const Partition& partition,
                            FrameSpec* spec) const;

 private:
  const BlobStore& blobs_;
  const std::string numeric_profile_;
};

}  // namespace sheaf::coordinator
