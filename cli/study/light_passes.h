// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightPasses: the light passes of one setting of a study. A pass reaches every pixel, so it covers
// the whole frame, or the frame made smaller (cli/quote/shrunk_frame.h), however few tiles the
// study renders.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "absl/status/status.h"
#include "common/film/film.h"
#include "worker/render/tile_pass.h"

namespace sheaf::cli {

// The index in row-major planes over `window`, part of a frame of small_width_px x small_height_px,
// of the pixel in whose place pixel (x, y) of a larger frame lies; the nearest one in the window.
size_t IndexInPlace(const PixelRect& window, int32_t small_width_px, int32_t small_height_px,
                    int32_t x, int32_t y, int32_t width_px, int32_t height_px);
// The light of a rectangle of the frame, as an image of it: each pixel is that of `light` in its
// place. Requires: light is an image of the frame, or of the frame made smaller.
FrameImage LightOf(const FrameImage& light, const PixelRect& rect, int32_t frame_width_px,
                   int32_t frame_height_px);

// Not thread-safe.
class LightPasses {
 public:
  // The scene's frame has light paths and is of any size; the scene must outlive this. Renders at
  // most as many passes at once as fit in half of the free memory, but at least one.
  LightPasses(const render::CompiledScene& scene, int threads);

  // Renders passes until there are `count`, on all threads. Errors: as RenderLightPass.
  absl::Status RenderUntil(uint64_t count);
  uint64_t count() const { return count_; }
  // CPU seconds of all passes so far, on this machine, of a frame of this many pixels.
  double CpuSeconds(int64_t frame_pixels) const;
  // The means and standard errors of light paths alone, over the window of the scene's frame.
  // Requires: there are passes.
  const FrameImage& Image();

 private:
  const render::CompiledScene& scene_;
  const int threads_;
  TileTree tree_;
  uint64_t count_ = 0;
  double cpu_seconds_ = 0;
  std::optional<FrameImage> image_;  // At count_ passes.
};

}  // namespace sheaf::cli
