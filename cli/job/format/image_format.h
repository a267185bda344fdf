// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ImageFormat: the user's options for the EXRs that a command writes. Without options they are the
// coordinator's bytes; with options, this machine rewrites the image. The farm's copy is unchanged,
// so that it can be verified and continued.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/film/exr/exr_format.h"
#include "sheaf/v1/frame.pb.h"

namespace sheaf::cli {

// The meaning of depth.Z: as delivered by the farm, or as in plane_depth.h.
enum class ExrDepth : uint8_t { kRay, kPlane };

struct ImageFormat {
  ExrFormat exr;
  ExrDepth depth = ExrDepth::kRay;
  // Attributes of the file; empty or false: without. Those that differ from run to run are only
  // written on request, so that equal images are equal files.
  std::string owner, comments;
  std::string frames_per_second;  // "24", or a ratio: "24000/1001".
  bool date = false;              // capDate, in UTC, and utcOffset.
  bool render_time = false;       // sheaf:renderSeconds and sheaf:cpuSeconds.

  bool IsDefault() const { return *this == ImageFormat(); }
  friend bool operator==(const ImageFormat&, const ImageFormat&) = default;
};

// Errors: kInvalidArgument; those of CheckExrFormat.
absl::Status CheckImageFormat(const ImageFormat& format);

// Adds the attributes. frame: the image's. Requires: CheckImageFormat is OK.
void AddAttributes(const ImageFormat& format, const v1::Frame& frame, absl::Time now,
                   FrameImage* image);

// The options of `sheaf watch` that give the format, and their values; flags have none.
std::vector<std::pair<std::string, std::string>> FormatOptions(const ImageFormat& format);

}  // namespace sheaf::cli
