// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Zoomed pilots of emitters that a pilot's small image may miss. Where an emitter is seen is
// known from the scene (visible_emitters.h); a few pixels about it, enlarged, of one sample each,
// tell which part of it is seen, how bright its surroundings are, and so the fraction of each
// pixel's samples that meets it:
//
//     emitters in view > places that are worth it > their images > pixels with a part of one
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/film/frame_image.h"
#include "common/film/tile_geometry.h"
#include "common/scene/scene_description.h"

namespace sheaf::coordinator {

inline constexpr int32_t kZoomedPilotScaleMax = 4;
// Each is a frame of the pilot, of which a farm does some hundred a second.
inline constexpr size_t kZoomedPilotsMax = 16;

struct ZoomedRegion {
  PixelRect rect;     // Within the frame, in its pixels.
  int32_t scale = 1;  // One of them has so many of the zoomed pilot along each side.
  friend bool operator==(const ZoomedRegion&, const ZoomedRegion&) = default;

  double SampleCount() const { return static_cast<double>(rect.PixelCount()) * scale * scale; }
};
struct ZoomedPilot {
  ZoomedRegion place;
  FrameImage image;  // The frame enlarged, at the place; with the layers of light paths.
};

// A pixel of the frame and the share of its filter that an emitter has; colors of R, G and B.
struct EmitterPixel {
  int32_t x = 0, y = 0;
  double fraction = 0;
  std::array<double, 3> emitter, beside;
};

// Places in the window about emitters that are no wider or no higher than emitter_px_max, the
// cheapest first, as long as their zoomed pilots have at most samples_max samples together; at most
// kZoomedPilotsMax. No two have a pixel in common.
std::vector<ZoomedRegion> ChooseZoomedRegions(std::span<const PixelRect> emitters,
                                              const PixelRect& window, double emitter_px_max,
                                              double samples_max);

// The pixels of the window whose filter reaches an emitter of the zoomed pilot, also those outside
// of its rectangle; none where it shows no emitter, or nothing beside it.
std::vector<EmitterPixel> EmitterPixelsOf(const ZoomedPilot& zoomed_pilot,
                                          const FilterDescription& filter, const PixelRect& window);

}  // namespace sheaf::coordinator
