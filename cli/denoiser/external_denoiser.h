// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AddExternalLayer: adds the output of an external denoiser to an image. The denoiser is a command
// of the user (user_command.h), which gets two further words:
//
//     COMMAND INPUT.exr OUTPUT.exr
//
// INPUT.exr is the delivered image with all of its layers, among them R, G, B, albedo, normal and
// stderr (docs/outputs.md). The command writes OUTPUT.exr, of the same size, with R, G and B in the
// same primaries. Both are in a folder of their own, which is removed afterwards.
#pragma once

#include <stop_token>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/film/frame_image.h"

namespace sheaf::cli {

// The longest that a denoiser may take for an image.
inline constexpr absl::Duration kDenoiserTimeMax = absl::Hours(1);
// The command, in the image's metadata.
inline constexpr char kExternalDenoiserKey[] = "externalDenoiser";

// Checks that the command can be run, as far as that is known before there is an image. An empty
// command is OK: there is none. Errors: kInvalidArgument.
absl::Status CheckDenoiser(const std::string& command);

// delivered: the bytes of the image's EXR. Adds kExternalLayer and the metadata. Errors:
// kFailedPrecondition if the command fails or writes something else (the text begins with the
// command); kCancelled. The image is then unchanged.
absl::Status AddExternalLayer(const std::string& command, std::string_view delivered,
                              absl::Duration time_max, const std::stop_token& stop,
                              FrameImage* image);

}  // namespace sheaf::cli
