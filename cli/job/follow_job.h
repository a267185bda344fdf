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
#include "cli/job/summary.h"
#include "common/content/blob_store.h"

namespace sheaf::cli {

// Uploads the blobs that the coordinator lacks, several concurrently, and shows the progress. own:
// the store of a coordinator in this process, which is written without messages; null: it is
// elsewhere.
absl::Status UploadMissing(FarmClient* client, const PreparedJob& job,
                           const BlobStore* own = nullptr);
// Writes the blob, whose bytes are hashed on the way. Errors: those of BlobWriter;
// kFailedPrecondition if its file has changed.
absl::Status StoreBlob(const BlobStore& store, const BlobSource& blob);

// Where and how a job's images are written on this machine.
struct Delivery {
  std::vector<ImagePaths> paths;  // One per frame, by ascending frame number; empty: no images.
  ViewTransform view;             // For PNGs.
  ImageFormat format;             // For EXRs.
  std::string options;            // The same as options of `sheaf watch`, "-o room.exr".
  std::string denoise_with = {};  // The denoiser's command; empty: none.
  std::string png_layer = {};     // As for ImageOfLayer.
  std::string black_advice = {};  // What to do if an image is black; empty: unknown.
  Detail detail = Detail::kShort;
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

// Writes the images of a job as they become complete, even if others fail. An image is written
// again if the farm has delivered a better one: after an approval, a refinement or a correction.
class ImageSaver {
 public:
  // client and delivery must outlive the object.
  ImageSaver(FarmClient* client, const Delivery& delivery);

  // Whether the job has images that are not written yet.
  bool HasWork(const v1::Job& job) const;
  // Fetches and writes them; reports the path and the costs of each on standard error.
  void Save(const v1::Job& job);
  // The first failure; the others are reported on standard error. Errors: those of the calls, of
  // WriteOrKeep and AddExternalLayer.
  absl::Status status() const { return call_.ok() ? file_ : call_; }
  // Whether the failure is an image that the coordinator did not send.
  bool has_call_failed() const { return !call_.ok(); }

 private:
  // Digests of a frame's images.
  struct Taken {
    std::string written;
    std::string missed;  // The fetch failed while the job ran.
  };
  bool IsDue(const v1::Job& job, size_t i) const;
  void SaveFrame(const v1::Job& job, size_t i);
  void NoteFailure(const absl::Status& status, absl::Status* first);
  size_t FrameCount(const v1::Job& job) const;

  FarmClient* const client_;
  const Delivery& delivery_;
  std::vector<Taken> taken_;
  absl::Status call_, file_;
  bool stopped_ = false;  // The coordinator does not answer, or the user has interrupted it.
};

// Shows the job until it ends, and writes its images meanwhile. With json, prints it on standard
// output after each change. Errors: those of FarmClient::WatchJob.
absl::StatusOr<v1::Job> FollowJob(FarmClient* client, const std::string& name, bool json,
                                  ImageSaver* images);

// The frames that have no image, "3,5,10-12"; empty if all have one.
std::string MissingImages(const v1::Job& job);

// Reports the end of the job on standard error: its costs, or why it failed and which images are
// missing. images_written: each image has been reported, so a job of one image gets no further
// line. remedy: the command that renders missing images; empty: they are not mentioned. Returns the
// matching exit code.
ExitCode ReportEnd(const v1::Job& job, bool images_written, const std::string& remedy,
                   Detail detail);

// Runs FollowJob and ReportEnd. If interrupted, it says how to resume.
ExitCode FollowToTheEnd(FarmClient* client, const std::string& name, bool json,
                        const Delivery& delivery);

}  // namespace sheaf::cli
