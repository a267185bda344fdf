// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The picture as merged so far, as a PNG for a screen: sRGB curve, clamped, and shrunk by a whole
// factor where it is larger than any screen needs. Encoded pictures are kept, as several browsers
// ask for the same one.
#pragma once

#include <cstdint>
#include <list>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film.h"
#include "common/image/image_io.h"
#include "coordinator/service/farm_view.h"

namespace sheaf::coordinator {

// Pixels of a preview at most; larger pictures are averaged over squares of 2x2, 3x3 and so on.
inline constexpr int64_t kPreviewPixelCountMax = int64_t{1} << 21;
// Encoded pictures kept, the longest unused dropped first.
inline constexpr size_t kPreviewCacheCountMax = 8;

// Shape: row-major [height_px][width_px].
struct DisplayPicture {
  int32_t width_px = 0;
  int32_t height_px = 0;
  std::vector<Rgb8> pixels;
};

// Errors: kInternal where the picture lacks the channels R, G and B.
absl::StatusOr<DisplayPicture> MakeDisplayPicture(const FramePicture& picture);

class PreviewCache {
 public:
  // The PNG of a frame's present picture; `version` becomes the one that it shows.
  // Errors: as FarmView::Preview, and those of the PNG encoder.
  // Thread safety: from one thread at a time.
  absl::StatusOr<std::string> Png(const FarmView& farm, const std::string& job_id,
                                  const FrameView& frame, uint64_t* version);

 private:
  struct Entry {
    std::string job_id;
    int32_t frame_number = 0;
    uint64_t version = 0;
    std::string png;
  };
  // Most recently used first.
  std::list<Entry> entries_;
};

}  // namespace sheaf::coordinator
