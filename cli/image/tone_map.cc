// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/image/tone_map.h"

#include "common/base/check.h"

namespace sheaf::cli {

std::vector<Rgb8> ToneMapSrgb(const FramePicture& picture) {
  if (FramePicture shown; !(picture.color.chromaticities == Chromaticities())) {
    shown = picture;
    if (ConvertColor(Chromaticities(), &shown).ok()) return ToneMapSrgb(shown);
  }
  const std::vector<float>* red = picture.Find("R");
  const std::vector<float>* green = picture.Find("G");
  const std::vector<float>* blue = picture.Find("B");
  SHEAF_CHECK(red != nullptr && green != nullptr && blue != nullptr);
  std::vector<Rgb8> pixels(red->size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = {EncodeSrgb8((*red)[i]), EncodeSrgb8((*green)[i]), EncodeSrgb8((*blue)[i])};
  }
  return pixels;
}

}  // namespace sheaf::cli
