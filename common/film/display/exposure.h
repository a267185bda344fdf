// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Exposure of an image for display, in stops. An EXR is never exposed.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/film/frame_image.h"

namespace sheaf {

inline constexpr double kStopsMax = 64;

// How an image is exposed: by a number of stops, or by what it shows.
struct Exposure {
  bool is_automatic = false;
  double stops = 0;  // Values are multiplied by 2^stops.
};

inline constexpr char kAutomaticExposure[] = "auto";
// From "auto" or a number of stops within kStopsMax. Empty: 0 stops. Errors: kInvalidArgument.
absl::StatusOr<Exposure> ParseExposure(const std::string& text);

// Where the automatic exposure puts the logarithmic average of luminance: middle gray.
inline constexpr double kMiddleGray = 0.18;
// At most this fraction of the pixels gets brighter than 1.
inline constexpr double kSaturatedFraction = 0.05;
// The stops that bring the logarithmic average of luminance to kMiddleGray, or fewer where more
// than kSaturatedFraction of the pixels would be brighter than 1. Rounded to hundredths of a stop,
// as they are printed; 0 for a black image. Pixels that are black or not finite do not count.
// Source: Reinhard et al. 2002, "Photographic Tone Reproduction for Digital Images", sec. 3.1.
// Requires: R, G and B exist.
double AutomaticStops(const FrameImage& image);

// The channels R, G and B alone, multiplied by 2^stops. Requires: they exist.
FrameImage Exposed(const FrameImage& image, double stops);

}  // namespace sheaf
