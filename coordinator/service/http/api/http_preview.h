// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Encodes the image so far as PNG, in the layers of image_layer.h, and caches encoded images, as
// several browsers request the same one.
#pragma once

#include <cstdint>
#include <list>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "coordinator/service/http/image/image_layer.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// Maximum number of cached images; the least recently used are dropped.
inline constexpr size_t kPreviewCacheCountMax = 8;
inline constexpr size_t kThumbnailCacheCountMax = 1024;

// Selects an image of a frame.
struct PreviewChoice {
  ImageLayer layer = ImageLayer::kImage;
  bool thumbnail = false;        // A small copy; only of ImageLayer::kImage.
  std::optional<int32_t> round;  // The image at the end of this round; none: the present image.
  friend bool operator==(const PreviewChoice&, const PreviewChoice&) = default;
};

struct EncodedPreview {
  // The FrameView::preview_version of the image.
  uint64_t version = 0;
  std::string png;
  std::optional<LayerRange> range;  // Only for layers in false color.
};

class PreviewCache {
 public:
  explicit PreviewCache(size_t count_max = kPreviewCacheCountMax) : count_max_(count_max) {}

  // The version of the selected image; 0 if there is none.
  static uint64_t VersionOf(const FrameView& frame, const PreviewChoice& choice);

  // Returns the selected image of a frame. Errors: as for FarmView::Preview and MakeDisplayImage,
  // and those of the PNG encoder. Thread safety: one thread at a time.
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
