// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Summaries of finished work: three lines per image, one line per job.
#pragma once

#include <string>

#include "cli/job/prepared_job.h"
#include "sheaf/v1/job.pb.h"

namespace sheaf::cli {

// Three lines: what was rendered, its cost and accuracy, and where it is.
//
//   frame 1: 640x360, 128 samples
//     12.3 s, error ±4.6 % (relMSE 0.0021)
//     written to out.exr
//
// Unknown items are omitted. A biased image is marked as such. Without a target error, or layers
// that tell the cause of fireflies, these are named by kAll only.
std::string FormatImageSummary(const v1::Frame& frame, const ImagePaths& paths, Detail detail);
// "error ±19 % of the left eye, ±18 % of the right, ±27 % of their difference"; empty unless the
// frame is a complete stereo frame.
std::string FormatEyeErrors(const v1::Frame& frame);
// "jobs/7: 3 frames, 12.3 s, error ±4.6 % (relMSE 0.0021)": the same over all frames.
std::string FormatJobSummary(const v1::Job& job, Detail detail);

}  // namespace sheaf::cli
