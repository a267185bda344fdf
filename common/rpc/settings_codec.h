// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Converts FrameSettings and pixel rectangles to and from messages, for client, coordinator and
// worker.
#pragma once

#include "absl/status/statusor.h"
#include "common/film/tile_geometry.h"
#include "common/scene/settings/render_settings.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf {

v1::PixelRect ToWire(const PixelRect& rect);
PixelRect FromWire(const v1::PixelRect& rect);

v1::FrameSettings ToWire(const FrameSettings& settings);
// Does not check the numbers. A color transport unknown to this version becomes kAuto.
// Errors: kInvalidArgument for unknown outputs, primaries, sensors or techniques, and for values
// out of range.
absl::StatusOr<FrameSettings> FromWire(const v1::FrameSettings& wire);
// The same for showing settings: values that are unknown to this version become the defaults.
FrameSettings ReadUnchecked(const v1::FrameSettings& wire);

}  // namespace sheaf
