// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PNG files that say what they show: image_io.h writes them without.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "common/image/image_io.h"

namespace sheaf {

struct PngTags {
  bool is_srgb = true;                      // The values are sRGB's.
  std::map<std::string, std::string> text;  // By keyword: 1 to 79 characters of Latin-1.
};

// EncodePng with what the file shall say of itself. Requires and errors: the same.
absl::StatusOr<std::string> EncodeTaggedPng(int width, int height, const std::vector<Rgb8>& pixels,
                                            const PngTags& tags);

}  // namespace sheaf
