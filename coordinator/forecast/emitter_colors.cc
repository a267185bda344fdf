// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/emitter_colors.h"

#include <cmath>
#include <string>

#include "common/base/check.h"
#include "common/film/light_path_kind.h"

namespace sheaf::coordinator {

EmitterColors::EmitterColors(const FrameImage& image) : window_(image.window) {
  const std::string seen =
      kLightPathNames[static_cast<size_t>(LightPathKind::kEmission)].name + std::string(".");
  for (size_t i = 0; i < 3; ++i) {
    all_[i] = image.Find(std::string(1, "RGB"[i]));
    seen_[i] = image.Find(seen + "RGB"[i]);
    SHEAF_CHECK(all_[i] != nullptr && seen_[i] != nullptr);
  }
}

EmitterColors::Color EmitterColors::ColorAt(const Planes& planes, int32_t x, int32_t y) const {
  const size_t p = window_.IndexOf(x, y);
  return {std::fabs((*planes[0])[p]), std::fabs((*planes[1])[p]), std::fabs((*planes[2])[p])};
}

}  // namespace sheaf::coordinator
