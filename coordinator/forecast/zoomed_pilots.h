// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Zoomed pilots: images of emitters that a pilot's small image may miss. The scene gives the
// position of an emitter in the image (visible_emitters.h). An enlarged image of the few pixels
// around it, with one sample per pixel, shows which part of the emitter is visible and how bright
// its surroundings are, and so the fraction of each pixel's samples that meets the emitter:
//
//     visible emitters > regions worth rendering > their images > pixels that contain a part of one
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
// Limit of zoomed pilots. Each is a frame of the pilot; a farm renders some hundred frames a
// second.
inline constexpr size_t kZoomedPilotsMax = 16;

struct ZoomedRegion {
  PixelRect rect;     // Region of the frame, in its pixels.
  int32_t scale = 1;  // Pixels of the zoomed pilot per pixel of the frame, along each axis.
  friend bool operator==(const ZoomedRegion&, const ZoomedRegion&) = default;

  double SampleCount() const { return static_cast<double>(rect.PixelCount()) * scale * scale; }
};
struct ZoomedPilot {
  ZoomedRegion place;
  FrameImage image;  // The region of the enlarged frame, with the layers of kinds of paths.
};

// A pixel of the frame, and the fraction of its filter that an emitter covers. Colors are R, G and
// B: that of the emitter and that of its surroundings.
struct EmitterPixel {
  int32_t x = 0, y = 0;
  double fraction = 0;
  std::array<double, 3> emitter, beside;
};

// Chooses regions of the window around emitters that are at most emitter_px_max wide or at most as
// high, the cheapest first, while their zoomed pilots have at most samples_max samples in total; at
// most kZoomedPilotsMax regions. Regions do not overlap.
std::vector<ZoomedRegion> ChooseZoomedRegions(std::span<const PixelRect> emitters,
                                              const PixelRect& window, double emitter_px_max,
                                              double samples_max);

// Returns the pixels of the window whose filter reaches an emitter in the zoomed pilot, including
// pixels outside its region. Empty if the zoomed pilot shows no emitter, or nothing but emitters.
std::vector<EmitterPixel> EmitterPixelsOf(const ZoomedPilot& zoomed_pilot,
                                          const FilterDescription& filter, const PixelRect& window);

}  // namespace sheaf::coordinator
