// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Options that several commands share.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "cli/job/farm_channel.h"
#include "cli/job/prepared_job.h"

namespace sheaf::cli {

// --coordinator, by default from SHEAF_COORDINATOR, and --insecure.
void AddCoordinatorOption(CLI::App* command, FarmAddress* coordinator);
void AddJsonFlag(CLI::App* command, bool* json);
// SCENE and all options that affect its pixels.
void AddSettingsOptions(CLI::App* command, JobArguments* arguments);
// --output and --png, for images of a job submitted earlier, and --view.
void AddImageOptions(CLI::App* command, JobArguments* arguments);
// --frames.
void AddFramesOption(CLI::App* command, JobArguments* arguments);
// --resume-from.
void AddResumeOption(CLI::App* command, JobArguments* arguments);
// How the work is partitioned: --tile-size, --cell-size, --pass-samples and --lease-passes.
void AddPartitionOptions(CLI::App* command, JobArguments* arguments);
// For whom and where the work is done: --show, by default from SHEAF_SHOW, --pool, --require and
// --memory-min.
void AddPlacementOptions(CLI::App* command, JobArguments* arguments);
// --view, --display and --ocio; the last by default from OCIO.
void AddViewOptions(CLI::App* command, ViewArguments* view);
// The settings of a job, the paths of its images, and the partition of its work.
void AddJobOptions(CLI::App* command, JobArguments* arguments);

}  // namespace sheaf::cli
