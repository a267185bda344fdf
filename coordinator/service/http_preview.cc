// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Averages in linear light, then applies the sRGB curve (IEC 61966-2-1).
#include "coordinator/service/http_preview.h"

#include <algorithm>
#include <array>

namespace sheaf::coordinator {
namespace {

// The smallest whole factor that brings a picture under the limit, and leaves at least one pixel.
int32_t ShrinkFactor(int32_t width_px, int32_t height_px) {
  int32_t factor = 1;
  while (int64_t{width_px / factor} * (height_px / factor) > kPreviewPixelCountMax &&
         factor < std::min(width_px, height_px)) {
    ++factor;
  }
  return factor;
}

// The mean over the square of `edge` pixels at (x0, y0).
float MeanOfSquare(const std::vector<float>& plane, int32_t width, int32_t x0, int32_t y0,
                   int32_t edge) {
  double sum = 0;
  for (int32_t y = y0; y < y0 + edge; ++y) {
    const float* row = plane.data() + size_t{1} * y * width;
    for (int32_t x = x0; x < x0 + edge; ++x) sum += row[x];
  }
  return static_cast<float>(sum / (edge * edge));
}

}  // namespace

absl::StatusOr<DisplayPicture> MakeDisplayPicture(const FramePicture& picture) {
  if (!(picture.color.chromaticities == Chromaticities())) {
    FramePicture shown = picture;
    if (absl::Status status = ConvertColor(Chromaticities(), &shown); !status.ok()) return status;
    return MakeDisplayPicture(shown);
  }
  const std::array<const std::vector<float>*, 3> planes = {picture.Find("R"), picture.Find("G"),
                                                           picture.Find("B")};
  if (planes[0] == nullptr || planes[1] == nullptr || planes[2] == nullptr) {
    return absl::InternalError("the picture has no channels R, G and B");
  }
  const int32_t source_width = picture.window.Width();
  const int32_t factor = ShrinkFactor(source_width, picture.window.Height());
  DisplayPicture display;
  display.width_px = source_width / factor;
  display.height_px = picture.window.Height() / factor;
  display.pixels.reserve(static_cast<size_t>(display.width_px) * display.height_px);
  const auto level = [&](const std::vector<float>& plane, int32_t x, int32_t y) {
    return EncodeSrgb8(MeanOfSquare(plane, source_width, x * factor, y * factor, factor));
  };
  for (int32_t y = 0; y < display.height_px; ++y) {
    for (int32_t x = 0; x < display.width_px; ++x) {
      display.pixels.push_back(
          {level(*planes[0], x, y), level(*planes[1], x, y), level(*planes[2], x, y)});
    }
  }
  return display;
}

absl::StatusOr<std::string> PreviewCache::Png(const FarmView& farm, const std::string& job_id,
                                              const FrameView& frame, uint64_t* version) {
  for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
    if (entry->job_id != job_id || entry->frame_number != frame.frame_number) continue;
    if (entry->version == frame.preview_version) {
      entries_.splice(entries_.begin(), entries_, entry);
      *version = entry->version;
      return entry->png;
    }
    entries_.erase(entry);
    break;
  }
  const absl::StatusOr<PreviewView> preview = farm.Preview(job_id, frame.frame_number);
  if (!preview.ok()) return preview.status();
  const absl::StatusOr<DisplayPicture> display = MakeDisplayPicture(preview->picture);
  if (!display.ok()) return display.status();
  absl::StatusOr<std::string> png =
      EncodePng(display->width_px, display->height_px, display->pixels);
  if (!png.ok()) return png.status();
  *version = preview->version;
  entries_.push_front({job_id, frame.frame_number, preview->version, *png});
  if (entries_.size() > kPreviewCacheCountMax) entries_.pop_back();
  return png;
}

}  // namespace sheaf::coordinator
