// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/queries/frame_previews.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/film/exr/exr_channels.h"
#include "common/film/exr/exr_codec.h"
#include "common/film/exr/exr_pixel.h"
#include "common/film/shrink_image.h"
#include "coordinator/core/job/job_approval.h"

namespace sheaf::coordinator {
namespace {

std::string Name(const FrameId& id) {
  return absl::StrCat("jobs/", id.job_id, "/frames/", id.frame_number);
}

absl::Status NoSamplesYet(const FrameId& id) {
  return absl::UnavailableError(absl::StrCat(Name(id), ": has no samples yet"));
}

// The wanted channels of a developed image. The planes of the others are most of its bytes.
absl::StatusOr<FrameImage> CopyChannels(const FrameImage& image,
                                        const std::vector<std::string>& channels) {
  FrameImage copy;
  copy.window = image.window;
  copy.frame_width_px = image.frame_width_px;
  copy.frame_height_px = image.frame_height_px;
  copy.color = image.color;
  for (const std::string& channel : channels) {
    const std::vector<float>* plane = image.Find(channel);
    if (plane == nullptr) {
      return absl::InternalError(absl::StrCat("the image has no channel ", channel));
    }
    copy.channel_names.push_back(channel);
    copy.planes.push_back(*plane);
  }
  return copy;
}

}  // namespace

absl::StatusOr<FramePreviews::ShownFrame> FramePreviews::Find(const std::string& job_id,
                                                              int32_t frame_number) const {
  uint64_t id = 0;
  const bool is_number = absl::SimpleAtoi(job_id, &id);
  const MutexLock lock(&tables_.mutex);
  ShownFrame shown{{id, frame_number}, {}, false, nullptr, 0};
  const FrameRecord* frame = is_number ? tables_.scheduler.FindFrame(shown.id) : nullptr;
  if (frame == nullptr) {
    return absl::NotFoundError(
        absl::StrCat("jobs/", job_id, "/frames/", frame_number, ": there is no such frame"));
  }
  shown.window = frame->settings().window;
  shown.complete = frame->phase == FrameRecord::Phase::kDelivered;
  if (shown.complete) {
    const JobSpec& spec = tables_.scheduler.jobs().at(id).spec;
    shown.version =
        IsUnapproved(spec, frame_number) ? kUnapprovedPreviewVersion : kDeliveredPreviewVersion;
  }
  if (const auto found = tables_.open_frames.find(shown.id);
      !shown.complete && found != tables_.open_frames.end() && found->second.preview_version > 0) {
    shown.open = found->second.frame;
    shown.version = found->second.preview_version;
  }
  return shown;
}

absl::StatusOr<FrameImage> FramePreviews::CpuImage(const ShownFrame& shown) const {
  const absl::StatusOr<std::vector<JobStore::TileCost>> costs = store_.TileCosts(shown.id);
  if (!costs.ok()) return costs.status();
  if (costs->empty()) {
    return absl::UnavailableError(absl::StrCat(Name(shown.id), ": none of its parts is kept"));
  }
  const PixelRect& window = shown.window;
  FrameImage image;
  image.window = window;
  image.frame_width_px = window.x1;
  image.frame_height_px = window.y1;
  image.channel_names = {kCpuChannel};
  std::vector<float> plane(static_cast<size_t>(window.PixelCount()));
  for (const JobStore::TileCost& cost : *costs) {
    const PixelRect& tile = cost.tile;
    const double seconds = absl::ToDoubleSeconds(cost.cpu_duration);
    const auto of_pixel = static_cast<float>(seconds / static_cast<double>(tile.PixelCount()));
    for (int32_t y = tile.y0; y < tile.y1; ++y) {
      std::fill_n(plane.data() + window.IndexOf(tile.x0, y), tile.Width(), of_pixel);
    }
  }
  image.planes.push_back(std::move(plane));
  return image;
}

absl::StatusOr<PreviewView> FramePreviews::Preview(const std::string& job_id, int32_t frame_number,
                                                   const std::vector<std::string>& channels) const {
  const absl::StatusOr<ShownFrame> shown = Find(job_id, frame_number);
  if (!shown.ok()) return shown.status();
  absl::StatusOr<FrameImage> copy;
  if (channels == std::vector<std::string>{kCpuChannel}) {
    copy = CpuImage(*shown);
  } else if (shown->complete) {
    const absl::StatusOr<std::string> path = images_.FindDelivered(shown->id);
    if (!path.ok()) return path.status();
    const absl::StatusOr<FrameImage> image = ReadFrameImage(*path);
    if (!image.ok()) return image.status();
    copy = CopyChannels(*image, channels);
  } else if (shown->open != nullptr) {
    const MutexLock lock(&shown->open->mutex);
    const FrameImage& image = shown->open->merge.image();
    // For light, only means over squares are shown, which are far less to copy.
    const bool is_light = channels == std::vector<std::string>{"R", "G", "B"};
    copy = is_light ? ShrinkImage(image, channels, kPreviewPixelCountMax)
                    : CopyChannels(image, channels);
  } else {
    return NoSamplesYet(shown->id);
  }
  if (!copy.ok()) return copy.status();
  return PreviewView{shown->version, *std::move(copy), shown->complete};
}

absl::StatusOr<PreviewView> FramePreviews::Thumbnail(const std::string& job_id,
                                                     int32_t frame_number) const {
  const absl::StatusOr<ShownFrame> shown = Find(job_id, frame_number);
  if (!shown.ok()) return shown.status();
  absl::StatusOr<FrameImage> small;
  if (shown->complete) {
    const absl::StatusOr<std::string> path = images_.ThumbnailPath(shown->id);
    if (!path.ok()) return path.status();
    small = ReadFrameImage(*path);
    if (absl::IsNotFound(small.status())) {
      return absl::UnavailableError(absl::StrCat(Name(shown->id), ": no thumbnail was kept"));
    }
  } else if (shown->open != nullptr) {
    const MutexLock lock(&shown->open->mutex);
    small = ShrinkImage(shown->open->merge.image(), {"R", "G", "B"}, kThumbnailPixelCountMax);
  } else {
    return NoSamplesYet(shown->id);
  }
  if (!small.ok()) return small.status();
  return PreviewView{shown->version, *std::move(small), shown->complete};
}

absl::StatusOr<PreviewView> FramePreviews::RoundPreview(const std::string& job_id,
                                                        int32_t frame_number, int32_t round) const {
  const absl::StatusOr<ShownFrame> shown = Find(job_id, frame_number);
  if (!shown.ok()) return shown.status();
  const uint64_t version = rounds_.VersionOf(shown->id, round);
  absl::StatusOr<FrameImage> image = rounds_.Read(shown->id, round);
  if (!image.ok()) return image.status();
  return PreviewView{version, *std::move(image), shown->complete};
}

absl::StatusOr<PixelView> FramePreviews::ReadPixel(const std::string& job_id, int32_t frame_number,
                                                   int32_t x_px, int32_t y_px) const {
  const absl::StatusOr<ShownFrame> shown = Find(job_id, frame_number);
  if (!shown.ok()) return shown.status();
  const PixelRect& window = shown->window;
  if (x_px < window.x0 || x_px >= window.x1 || y_px < window.y0 || y_px >= window.y1) {
    return absl::OutOfRangeError(absl::StrCat(Name(shown->id), ": no pixel ", x_px, ", ", y_px,
                                              " is rendered; they are ", window.x0, ",", window.y0,
                                              " to ", window.x1, ",", window.y1));
  }
  PixelView pixel{shown->version, {}};
  if (shown->complete) {
    const absl::StatusOr<std::string> path = images_.FindDelivered(shown->id);
    if (!path.ok()) return path.status();
    auto values = ReadImagePixel(*path, x_px, y_px);
    if (!values.ok()) return values.status();
    pixel.channels = *std::move(values);
    return pixel;
  }
  if (shown->open == nullptr) return NoSamplesYet(shown->id);
  const MutexLock lock(&shown->open->mutex);
  const FrameImage& image = shown->open->merge.image();
  const auto index = static_cast<size_t>(image.window.IndexOf(x_px, y_px));
  for (size_t i = 0; i < image.planes.size(); ++i) {
    pixel.channels.emplace_back(FileChannelName(image.channel_names[i]), image.planes[i][index]);
  }
  return pixel;
}

}  // namespace sheaf::coordinator
