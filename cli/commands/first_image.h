// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderFirstImage: what loading takes, measured by doing what `sheaf render` does.
//
//     PrepareJob > LocalFarm::Open > UploadMissing > CreateJob > StartWorker > WatchJob
#pragma once

#include "cli/exit_code.h"
#include "cli/interruption.h"
#include "cli/job/prepared_job.h"
#include "cli/profile/memory_account.h"
#include "common/base/load_phases.h"

namespace sheaf::cli {

struct FirstImage {
  LoadTimes times;       // Until the image was delivered.
  MemoryAccount memory;  // Where asked: after the task at whose end the process was largest.
};

// Renders the image with one sample a pixel, in a farm of this process, and writes no file. Prints
// the notes on the scene. Returns the code of a failure, which is also printed, or kOk. Requires:
// nothing of the scene was read yet, so that the times are those of `sheaf render`; accounts of
// memory add to them.
ExitCode RenderFirstImage(JobArguments arguments, bool measures_memory,
                          const Interruption& interruption, FirstImage* image);

}  // namespace sheaf::cli
