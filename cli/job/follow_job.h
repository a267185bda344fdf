// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The steps that submit, watch and render share after scenes are read: upload missing blobs, follow
// the job until it ends, fetch its images.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "cli/exit_code.h"
#include "cli/image/view_transform.h"
#include "cli/job/farm_client.h"
#include "cli/job/prepared_job.h"

namespace sheaf::cli {

// Uploads the blobs that the coordinator lacks, several concurrently, and shows the progress.
absl::Status UploadMissing(FarmClient* client, const PreparedJob& job);

// Where and how a job's images are written on this machine.
struct Delivery {
  std::vector<ImagePaths> paths;  // One per frame, by ascending frame number; empty: no images.
  ViewTransform view;             // For PNGs.
  ImageFormat format;             // Of EXRs.
  std::string options;            // The same as options of `sheaf watch`, "-o room.exr".
  std::string denoise_with = {};  // The denoiser's command; empty: none.
  std::string black_advice = {};  // What to do if an image is black; empty: unknown.
};
// Checks everything that is known before the scene is read. Errors: those of CheckOutputs.
absl::Status ProbeOutputs(const JobArguments& arguments);
// For a job prepared on this machine. Errors: those of CheckOutputs, which also checks the scene's
// files.
absl::StatusOr<Delivery> MakeDelivery(const JobArguments& arguments, const PreparedJob& job,
                                      ViewTransform view);
// For a job submitted earlier, by the arguments' output and png; no delivery if both are empty.
// Errors: those of CheckOutputs; kInvalidArgument if one name would hold several frames.
absl::StatusOr<Delivery> MakeDelivery(JobArguments arguments, const v1::Job& job,
                                      ViewTransform view);
// "sheaf watch jobs/7 -o room.exr": the command that fetches the images after this command has
// ended.
std::string FetchCommand(const FarmClient& client, const std::string& name,
                         const Delivery& delivery);

// Shows the job until it ends. With json, prints it on standard output after each change. Errors:
// those of FarmClient::WatchJob.
absl::StatusOr<v1::Job> FollowJob(FarmClient* client, const std::string& name, bool json);

// Fetches all images of a job that succeeded; reports the path and the costs of each on standard
// error. An image that cannot be written or denoised does not prevent the others. Errors: those of
// the calls; the first of WriteOrKeep and AddExternalLayer.
absl::Status SaveImages(FarmClient* client, const v1::Job& job, const Delivery& delivery);

// Reports on standard error how the job ended: its costs, or why it failed. images_written:
// SaveImages has reported each image, so a job of one image gets no further line. Returns the
// matching exit code.
ExitCode ReportEnd(const v1::Job& job, bool images_written);

// Runs FollowJob, SaveImages and ReportEnd. If interrupted, it says how to resume.
ExitCode FollowToTheEnd(FarmClient* client, const std::string& name, bool json,
                        const Delivery& delivery);

}  // namespace sheaf::cli
