// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Frames whose paths count in several pixels: stereo frames and those with Technique::kSharing
// (worker/render/eyes, docs/adr/0151), and those with Technique::kMutations
// (worker/render/mutations, docs/adr/0270).
#pragma once

#include <string>

#include "absl/status/status.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf {

// Whether paths of the techniques reach pixels far from their own.
constexpr bool ReachesFarPixels(TechniqueSet techniques) {
  return SharesPaths(techniques) || MutatesPaths(techniques);
}
// Whether the frame has one tile, its whole film, because paths reach pixels far from their own.
inline bool HasOneTile(const FrameSettings& settings) {
  return settings.IsStereo() || ReachesFarPixels(settings.techniques);
}

// Whether the frame has no crop. For a stereo frame, before or after its film is doubled.
inline bool IsWholeFilm(const FrameSettings& settings) {
  return settings.window == PixelRect{0, 0, settings.width_px, settings.height_px};
}

// Why the settings cannot be those of a frame whose pixels or eyes share paths: a crop, other
// techniques, several light samples, outputs beside the image. Empty if they can. Requires:
// HasOneTile(settings).
std::string WhyNoSharing(const FrameSettings& settings);
// The same as an error: kInvalidArgument. OK also for frames that do not share paths.
absl::Status CheckSharing(const FrameSettings& settings);

}  // namespace sheaf
