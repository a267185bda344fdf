// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PNG files with metadata about their content; image_io.h writes files without it.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "common/image/image_io.h"

namespace sheaf {

struct PngTags {
  bool is_srgb = true;                      // The values are sRGB-encoded.
  std::map<std::string, std::string> text;  // By keyword: 1 to 79 characters of Latin-1.
};

// EncodePng with metadata. Requires and errors: the same.
absl::StatusOr<std::string> EncodeTaggedPng(int width, int height, const std::vector<Rgb8>& pixels,
                                            const PngTags& tags);

}  // namespace sheaf
