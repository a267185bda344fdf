// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/api/http_preview.h"

#include <utility>

namespace sheaf::coordinator {
namespace {

absl::StatusOr<PreviewView> ViewOf(const FarmView& farm, const std::string& job_id,
                                   int32_t frame_number, const PreviewChoice& choice) {
  if (choice.thumbnail) return farm.Thumbnail(job_id, frame_number);
  if (choice.round) return farm.RoundPreview(job_id, frame_number, *choice.round);
  return farm.Preview(job_id, frame_number, ChannelsOf(choice.layer));
}

}  // namespace

uint64_t PreviewCache::VersionOf(const FrameView& frame, const PreviewChoice& choice) {
  if (!choice.round) return frame.preview_version;
  const auto index = static_cast<size_t>(*choice.round);
  return index < frame.rounds.size() ? frame.rounds[index].preview_version : 0;
}

absl::StatusOr<EncodedPreview> PreviewCache::Find(const FarmView& farm, const std::string& job_id,
                                                  const FrameView& frame,
                                                  const PreviewChoice& choice) {
  for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
    if (entry->job_id != job_id || entry->frame_number != frame.frame_number ||
        entry->choice != choice) {
      continue;
    }
    if (entry->preview.version == VersionOf(frame, choice)) {
      entries_.splice(entries_.begin(), entries_, entry);
      return entry->preview;
    }
    entries_.erase(entry);
    break;
  }
  const absl::StatusOr<PreviewView> view = ViewOf(farm, job_id, frame.frame_number, choice);
  if (!view.ok()) return view.status();
  const absl::StatusOr<DisplayImage> display = MakeDisplayImage(view->image, choice.layer);
  if (!display.ok()) return display.status();
  absl::StatusOr<std::string> png =
      EncodePng(display->width_px, display->height_px, display->pixels);
  if (!png.ok()) return png.status();
  EncodedPreview preview{view->version, *std::move(png), display->range};
  entries_.push_front({job_id, frame.frame_number, choice, preview});
  if (entries_.size() > count_max_) entries_.pop_back();
  return preview;
}

}  // namespace sheaf::coordinator
