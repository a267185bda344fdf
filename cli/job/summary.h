// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Summaries of finished work: one line per image, one line per job.
#pragma once

#include <string>

#include "cli/job/prepared_job.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf::cli {

// "out.exr: 640x360, 128 samples, 12.3 s, 2.4 M samples/s, 6.1 M rays/s, relMSE 2.1e-03, 0
// non-finite": resolution, samples per pixel, wall time, the farm's rates over that time, the
// estimated error. Unknown items are omitted. A biased image is marked as such.
std::string FormatImageSummary(const v1::Frame& frame, const ImagePaths& paths);
// "jobs/7: 3 frames, 12.3 s, 2.4 M samples/s, ...": the same over all frames.
std::string FormatJobSummary(const v1::Job& job);

}  // namespace sheaf::cli
