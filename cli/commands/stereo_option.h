// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The option that renders two eyes.
#pragma once

#include "common/command_line/command_line.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::cli {

// --stereo. *settings must outlive the command.
void AddStereoOption(CLI::App* command, RenderSettings* settings);

}  // namespace sheaf::cli
