// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What submit, watch and render share once scenes are read: upload what is missing, watch until the
// end, bring the pictures here.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "cli/exit_code.h"
#include "cli/image/view_transform.h"
#include "cli/job/farm_client.h"
#include "cli/job/prepared_job.h"

namespace sheaf::cli {

// Uploads the blobs that the coordinator lacks, several at a time, with a progress line.
absl::Status UploadMissing(FarmClient* client, const PreparedJob& job);

// How a job's pictures come to this machine.
struct Delivery {
  std::vector<PicturePaths> paths;  // One per frame, in the order of numbers; none: not at all.
  ViewTransform view;               // For PNGs.
  std::string options;              // The same for `sheaf watch`, "-o room.exr".
};
// Checks as much as is known before the scene is read. Errors: those of CheckOutputs.
absl::Status ProbeOutputs(const JobArguments& arguments);
// For a job that was prepared here. Errors: those of CheckOutputs, also for files of the scene.
absl::StatusOr<Delivery> MakeDelivery(const JobArguments& arguments, const PreparedJob& job,
                                      ViewTransform view);
// For a job that was submitted before, by arguments' output and png; none where both are empty.
// Errors: those of CheckOutputs; kInvalidArgument where one name stands for several frames.
absl::StatusOr<Delivery> MakeDelivery(JobArguments arguments, const v1::Job& job,
                                      ViewTransform view);
// "sheaf watch jobs/7 -o room.exr": what brings the pictures once this command has ended.
std::string FetchCommand(const FarmClient& client, const std::string& name,
                         const Delivery& delivery);

// Shows the job until it ends. With json, prints it on standard output whenever it changes.
// Errors: those of FarmClient::WatchJob.
absl::StatusOr<v1::Job> FollowJob(FarmClient* client, const std::string& name, bool json);

// Fetches all pictures of a job that succeeded; says on standard error of each where it is and what
// it took. A picture that cannot be written does not keep the others from it.
// Errors: those of the calls; the first of WriteOrKeep.
absl::Status SavePictures(FarmClient* client, const v1::Job& job, const Delivery& delivery);

// Says on standard error how it ended: what it took, or why it failed. pictures_written:
// SavePictures has told of each picture, so a job of one needs no line of its own. Returns the code
// that fits.
ExitCode ReportEnd(const v1::Job& job, bool pictures_written);

// The usual way through all of these: FollowJob, SavePictures, ReportEnd. Interrupted, it says how
// to go on.
ExitCode FollowToTheEnd(FarmClient* client, const std::string& name, bool json,
                        const Delivery& delivery);

}  // namespace sheaf::cli
