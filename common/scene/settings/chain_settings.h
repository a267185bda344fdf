// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Frames with Technique::kChains (worker/render/integrator/chains.h).
#pragma once

#include "absl/status/status.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf {

// Error: kInvalidArgument where the settings combine chains with other techniques, or with several
// light samples. OK for frames without chains.
absl::Status CheckChains(const FrameSettings& settings);

}  // namespace sheaf
