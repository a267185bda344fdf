// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FramePreviews: images of frames: as merged so far, as delivered, at the ends of rounds, and as
// thumbnails.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/service/farm/delivery/delivered_images.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/service/view/pixel_view.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/round_previews.h"

namespace sheaf::coordinator {

// The version of a delivered frame's preview, which never changes again.
inline constexpr uint64_t kDeliveredPreviewVersion = uint64_t{1} << 32;
// The same for an image that waits for approval, because the final one differs.
inline constexpr uint64_t kUnapprovedPreviewVersion = kDeliveredPreviewVersion - 1;

// Thread safety: all members may be called concurrently.
class FramePreviews {
 public:
  // All arguments must outlive the object.
  FramePreviews(FarmTables* tables, JobStore* store, const RoundPreviews* rounds,
                const DeliveredImages* images)
      : tables_(*tables), store_(*store), rounds_(*rounds), images_(*images) {}

  // As in FarmView.
  absl::StatusOr<PreviewView> Preview(const std::string& job_id, int32_t frame_number,
                                      const std::vector<std::string>& channels) const;
  absl::StatusOr<PreviewView> Thumbnail(const std::string& job_id, int32_t frame_number) const;
  absl::StatusOr<PreviewView> RoundPreview(const std::string& job_id, int32_t frame_number,
                                           int32_t round) const;
  // All channels of a pixel of the image so far, or as delivered. Errors: kNotFound (no such
  // frame); kUnavailable (no samples yet); kOutOfRange (outside of the rendered pixels); those of
  // ReadImagePixel.
  absl::StatusOr<PixelView> ReadPixel(const std::string& job_id, int32_t frame_number, int32_t x_px,
                                      int32_t y_px) const;

 private:
  // A frame whose image is requested; open is null if it has no samples in memory.
  struct ShownFrame {
    FrameId id;
    PixelRect window;
    bool complete = false;
    std::shared_ptr<OpenFrame> open;
    uint64_t version = 0;
  };
  // Errors: kNotFound.
  absl::StatusOr<ShownFrame> Find(const std::string& job_id, int32_t frame_number) const;
  // kCpuChannel of the frame. Errors: kUnavailable (no part of it is kept).
  absl::StatusOr<FrameImage> CpuImage(const ShownFrame& shown) const;

  FarmTables& tables_;
  JobStore& store_;
  const RoundPreviews& rounds_;
  const DeliveredImages& images_;
};

}  // namespace sheaf::coordinator
