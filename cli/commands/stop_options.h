// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Options that say when a frame stops.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/job/prepared_job.h"

namespace sheaf::cli {

// --target-error, --certified, --time and --budget.
void AddStopOptions(CLI::App* command, StopArguments* stop);

}  // namespace sheaf::cli
