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
#include "cli/farm_client.h"
#include "cli/prepared_job.h"
#include "cli/view_transform.h"

namespace sheaf::cli {

// Uploads the blobs that the coordinator lacks, several at a time, with a progress line.
absl::Status UploadMissing(FarmClient* client, const PreparedJob& job);

// Where the pictures of a job go that was submitted before: as arguments' output and png say, none
// where both are empty. Errors: kInvalidArgument where one name stands for several frames.
absl::StatusOr<std::vector<PicturePaths>> PathsOf(const v1::Job& job, JobArguments arguments);

// Shows the job until it ends. With json, prints it on standard output whenever it changes.
// Errors: those of FarmClient::WatchJob.
absl::StatusOr<v1::Job> FollowJob(FarmClient* client, const std::string& name, bool json);

// Fetches all pictures of a job that succeeded; says on standard error of each where it is and what
// it took.
// paths: one per frame, in the order of numbers. view: for PNGs. Errors: those of the calls and of
// writing.
absl::Status SavePictures(FarmClient* client, const v1::Job& job,
                          const std::vector<PicturePaths>& paths, const ViewTransform& view);

// Says on standard error how it ended: what it took, or why it failed. pictures_written:
// SavePictures has told of each picture, so a job of one needs no line of its own. Returns the code
// that fits.
ExitCode ReportEnd(const v1::Job& job, bool pictures_written);

// The usual way through all of these: FollowJob, SavePictures, ReportEnd. Interrupted, it says how
// to go on.
ExitCode FollowToTheEnd(FarmClient* client, const std::string& name, bool json,
                        const std::vector<PicturePaths>& paths, const ViewTransform& view);

}  // namespace sheaf::cli
