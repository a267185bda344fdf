// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/image/tone_map.h"

#include "common/base/check.h"

namespace sheaf::cli {

std::vector<Rgb8> ToneMapSrgb(const FrameImage& image) {
  if (FrameImage shown; !(image.color.chromaticities == Chromaticities())) {
    shown = image;
    if (ConvertColor(Chromaticities(), &shown).ok()) return ToneMapSrgb(shown);
  }
  const std::vector<float>* red = image.Find("R");
  const std::vector<float>* green = image.Find("G");
  const std::vector<float>* blue = image.Find("B");
  SHEAF_CHECK(red != nullptr && green != nullptr && blue != nullptr);
  std::vector<Rgb8> pixels(red->size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = {EncodeSrgb8((*red)[i]), EncodeSrgb8((*green)[i]), EncodeSrgb8((*blue)[i])};
  }
  return pixels;
}

}  // namespace sheaf::cli
