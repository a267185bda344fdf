// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/shrunk_frame.h"

#include <algorithm>

namespace sheaf::cli {

FrameSettings ShrunkFrame(FrameSettings settings, int32_t shrink) {
  const auto length = [&](int32_t full) { return (full + shrink / 2) / shrink; };
  PixelRect& window = settings.window;
  const int32_t x0 = length(window.x0), y0 = length(window.y0);
  window = {x0, y0, std::max(x0 + 1, length(window.x1)), std::max(y0 + 1, length(window.y1))};
  settings.width_px = std::max(length(settings.width_px), window.x1);
  settings.height_px = std::max(length(settings.height_px), window.y1);
  return settings;
}

}  // namespace sheaf::cli
