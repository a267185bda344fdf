// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// One reader for each format of ReadPlainImage. Each returns none for a file that it does not take.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "common/image/plain_image.h"

namespace sheaf {

// bytes: of the whole file, or of its beginning where the header is enough.
std::optional<PlainImage> ReadPng(std::string_view bytes, const PlainRequest& request);
// Baseline and progressive files of one or three components; not CMYK.
std::optional<PlainImage> ReadJpeg(std::string_view bytes, const PlainRequest& request);
std::optional<PlainImage> ReadPfm(std::string_view bytes, const PlainRequest& request);
// Gray, and red, green and blue of 8 bits each, without alpha or palette.
std::optional<PlainImage> ReadTga(std::string_view bytes, const PlainRequest& request);
// One part of halfs or floats whose data window is its display window.
std::optional<PlainImage> ReadExr(const std::string& path, const PlainRequest& request);

// An image of that size without numbers yet; none if it is empty or is larger than requested.
std::optional<PlainImage> MakePlainImage(int64_t width, int64_t height, int channels,
                                         PlainImage::Type type, const PlainRequest& request);

}  // namespace sheaf
