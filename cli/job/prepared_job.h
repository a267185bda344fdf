// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PreparedJob: scene files on this machine to what a submission needs: settings and manifest of
// every frame, and the blobs behind them.
//
//     paths > ReadScene > ResolveSettings, manifest > digests > PreparedJob
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "cli/image/view_transform.h"
#include "cli/job/farm_client.h"
#include "common/scene/settings/render_settings.h"
#include "coordinator/core/job.h"

namespace sheaf::cli {

// When frames are good enough, as asked for; see v1::StopRule.
struct StopArguments {
  double target_error = 0;      // 0 in all three: not asked for.
  double seconds = 0;           // Wall, of a frame.
  double budget_cpu_hours = 0;  // Of the job; each frame has an equal share.

  bool IsActive() const { return target_error > 0 || seconds > 0 || budget_cpu_hours > 0; }
};
using coordinator::kStoppedSamplesMax;

// What submit and render have in common.
struct JobArguments {
  std::string scene;   // A path, or a pattern with #### when frames is given.
  std::string frames;  // As ParseFrameRange; empty for a single picture.
  std::string output;  // A path or pattern; empty: from the scene.
  std::string png;     // The same for a PNG beside it; empty: none.
  ViewArguments view;  // What PNGs show the picture as.
  std::string title;   // Empty: the scene's file name.
  int32_t priority = 0;
  RenderSettings settings;
  StopArguments stop;
  std::string resume_from;   // A delivered EXR that the frame goes on from; empty: none.
  int32_t tile_size_px = 0;  // 0 in these four: the coordinator's choice.
  int32_t cell_size_px = 0;
  uint64_t pass_sample_count = 0;
  uint64_t lease_pass_count = 0;
};

struct PreparedFrame {
  int32_t number = 1;
  BlobDigest manifest;
  FrameSettings settings;
  std::string film_filename;          // As the scene names its picture; may be empty.
  FilterDescription filter = {};      // Of the scene.
  std::vector<PixelRect> lamps = {};  // As LampsInView has them.
  BlobDigest resumed = {};            // Of the EXR to go on from; empty: none.
};

struct PreparedJob {
  std::vector<PreparedFrame> frames;
  std::map<std::string, BlobSource> blobs;  // By digest.
  std::vector<std::string> diagnostics;     // Notes and warnings of the reader, each once.
};

// Errors: kInvalidArgument where the pictures' names do not say what they hold.
absl::Status CheckPictureNames(const JobArguments& arguments);
// Errors: kInvalidArgument where the arguments do not fit together: wrong usage, not a wrong scene.
absl::Status CheckJobArguments(const JobArguments& arguments);

// Reads all frames, several at a time, and hashes every file once.
// Requires: CheckJobArguments is OK.
// Errors: kInvalidArgument (a scene has errors: all of them, one a line); kNotFound and
// kPermissionDenied for files; kFailedPrecondition for files that change meanwhile.
absl::StatusOr<PreparedJob> PrepareJob(const JobArguments& arguments);

// Where a frame's picture goes.
struct PicturePaths {
  std::string exr;
  std::string png;  // Empty: none is wanted.
};
// With #### where the frame's number goes. An output that ends in .png names a PNG with an EXR
// beside it.
PicturePaths OutputPatterns(const JobArguments& arguments, const PreparedJob& job);
// The same for all frames, in their order.
std::vector<PicturePaths> OutputPaths(const JobArguments& arguments, const PreparedJob& job);
// The files of this machine that the job is made of.
std::vector<std::string> InputPaths(const PreparedJob& job);

// The view for the PNGs of these arguments, found before there are pictures. It is the default
// where no PNG is written and none is named. Errors: those of ViewTransform::Open.
absl::StatusOr<ViewTransform> OpenView(const JobArguments& arguments);

v1::StopRule StopRuleOf(const StopArguments& stop, int frame_count);
v1::CreateJobRequest MakeCreateJobRequest(const JobArguments& arguments, const PreparedJob& job);

// A random UUID (version 4).
std::string MakeRequestId();

}  // namespace sheaf::cli
