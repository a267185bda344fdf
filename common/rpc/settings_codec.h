// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameSettings and pixel rectangles as messages, one codec for client, coordinator and worker.
#pragma once

#include "absl/status/statusor.h"
#include "common/film/tile_geometry.h"
#include "common/scene/settings/render_settings.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf {

v1::PixelRect ToWire(const PixelRect& rect);
PixelRect FromWire(const v1::PixelRect& rect);

v1::FrameSettings ToWire(const FrameSettings& settings);
// Does not judge the numbers. A colour transport that this version does not know becomes kAuto.
// Errors: kInvalidArgument for outputs that it does not know.
absl::StatusOr<FrameSettings> FromWire(const v1::FrameSettings& wire);

}  // namespace sheaf
