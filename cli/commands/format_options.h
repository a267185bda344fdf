// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Options for the form of the EXRs that a command writes: --exr-type and the like.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/job/format/image_format.h"

namespace sheaf::cli {

void AddFormatOptions(CLI::App* command, ImageFormat* format);

}  // namespace sheaf::cli
