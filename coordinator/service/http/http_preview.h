// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The image as merged so far, as a PNG for a screen, in the layers of image_layer.h. Encoded
// images are kept, as several browsers ask for the same one.
#pragma once

#include <cstdint>
#include <list>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "coordinator/service/http/image_layer.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// Encoded images kept, the longest unused dropped first.
inline constexpr size_t kPreviewCacheCountMax = 8;
inline constexpr size_t kThumbnailCacheCountMax = 1024;

// Which image of a frame is wanted.
struct PreviewChoice {
  ImageLayer layer = ImageLayer::kImage;
  bool thumbnail = false;        // Small; of the image alone.
  std::optional<int32_t> round;  // As it was at this round's end; otherwise as it is.
  friend bool operator==(const PreviewChoice&, const PreviewChoice&) = default;
};

struct EncodedPreview {
  // FrameView::preview_version that it shows.
  uint64_t version = 0;
  std::string png;
  std::optional<LayerRange> range;  // Only for layers in false color.
};

class PreviewCache {
 public:
  explicit PreviewCache(size_t count_max = kPreviewCacheCountMax) : count_max_(count_max) {}

  // The version of the image that is chosen; 0 where there is none.
  static uint64_t VersionOf(const FrameView& frame, const PreviewChoice& choice);

  // The PNG of a frame's image.
  // Errors: as FarmView::Preview and MakeDisplayImage, and those of the PNG encoder.
  // Thread safety: from one thread at a time.
  absl::StatusOr<EncodedPreview> Find(const FarmView& farm, const std::string& job_id,
                                      const FrameView& frame, const PreviewChoice& choice);

 private:
  struct Entry {
    std::string job_id;
    int32_t frame_number = 0;
    PreviewChoice choice;
    EncodedPreview preview;
  };
  const size_t count_max_;
  // Most recently used first.
  std::list<Entry> entries_;
};

}  // namespace sheaf::coordinator
