// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What is told of finished work: one line a picture, one line a job.
#pragma once

#include <string>

#include "cli/job/prepared_job.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf::cli {

// "out.exr: 640x360, 128 samples, 12.3 s, 2.4 M samples/s, 6.1 M rays/s, relMSE 2.1e-03, 0
// non-finite": pixels, samples of a pixel, wall time, the farm's rates over that time, the
// estimated error. What cannot be told is left out. A picture that is biased is said to be.
std::string FormatPictureSummary(const v1::Frame& frame, const PicturePaths& paths);
// "jobs/7: 3 frames, 12.3 s, 2.4 M samples/s, ...": the same over all frames.
std::string FormatJobSummary(const v1::Job& job);

}  // namespace sheaf::cli
