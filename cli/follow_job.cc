// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/follow_job.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <map>
#include <mutex>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/frame_range.h"
#include "cli/job_json.h"
#include "cli/progress_line.h"
#include "cli/summary.h"
#include "common/base/file.h"
#include "common/film/exr_codec.h"

namespace sheaf::cli {
namespace {

constexpr size_t kUploadsMax = 4;  // At the same time; hides the way of many small files.
constexpr std::chrono::seconds kUploadSilence{2};  // A shorter upload is over before it is read.
constexpr uint64_t kPictureBytesMax = uint64_t{16} << 30;

// Bytes sent so far, shown.
class UploadProgress {
 public:
  explicit UploadProgress(uint64_t total_bytes)
      : total_bytes_(std::max<uint64_t>(total_bytes, 1)) {}
  void Add(uint64_t size_bytes) {
    const std::lock_guard<std::mutex> lock(mutex_);
    sent_bytes_ += size_bytes;
    const double share =
        std::min(1.0, static_cast<double>(sent_bytes_) / static_cast<double>(total_bytes_));
    line_.Show("uploading", share,
               absl::StrFormat("%.0f %% of %sB", 100 * share,
                               FormatCount(static_cast<double>(total_bytes_))));
  }

 private:
  std::mutex mutex_;
  ProgressLine line_{kUploadSilence};
  const uint64_t total_bytes_;
  uint64_t sent_bytes_ = 0;
};

absl::Status SavePicture(FarmClient* client, const v1::Frame& frame, const PicturePaths& paths,
                         const ViewTransform& view) {
  const absl::StatusOr<std::string> bytes = client->ReadFrameOutput(frame.name(), kPictureBytesMax);
  if (!bytes.ok()) return bytes.status();
  if (absl::Status status = WriteFileAtomically(paths.exr, *bytes); !status.ok()) return status;
  const absl::StatusOr<FramePicture> picture = ReadPicture(paths.exr);
  if (!picture.ok()) return picture.status();
  if (PictureDigest(*picture) != frame.picture_digest()) {
    return absl::DataLossError(absl::StrCat(
        paths.exr,
        ": is not the picture the coordinator delivered; fetch it again with sheaf watch"));
  }
  if (!paths.png.empty()) {
    if (absl::Status status = WriteView(view, *picture, paths.png); !status.ok()) return status;
  }
  std::fprintf(stderr, "sheaf: %s\n", FormatPictureSummary(frame, paths).c_str());
  return absl::OkStatus();
}

}  // namespace

absl::Status UploadMissing(FarmClient* client, const PreparedJob& job) {
  std::vector<BlobDigest> digests;
  for (const auto& [hex, blob] : job.blobs) digests.push_back(blob.digest);
  const absl::StatusOr<std::vector<BlobDigest>> missing = client->FindMissing(digests);
  if (!missing.ok()) return missing.status();
  if (missing->empty()) return absl::OkStatus();
  uint64_t total_bytes = 0;
  for (const BlobDigest& digest : *missing) total_bytes += digest.size_bytes;
  UploadProgress progress(total_bytes);
  std::atomic<size_t> next{0};
  std::mutex mutex;
  absl::Status first_error;
  {
    std::vector<std::jthread> uploads;
    for (size_t t = 0; t < std::min(kUploadsMax, missing->size()); ++t) {
      uploads.emplace_back([&] {
        for (size_t i = next++; i < missing->size(); i = next++) {
          const BlobSource& blob = job.blobs.at((*missing)[i].sha256_hex);
          const absl::Status status =
              client->Upload(blob, [&](uint64_t size_bytes) { progress.Add(size_bytes); });
          if (status.ok()) continue;
          const std::lock_guard<std::mutex> lock(mutex);
          if (first_error.ok()) first_error = status;
          next = missing->size();
        }
      });
    }
  }
  return first_error;
}

absl::StatusOr<std::vector<PicturePaths>> PathsOf(const v1::Job& job, JobArguments arguments) {
  if (arguments.output.empty() && arguments.png.empty()) return std::vector<PicturePaths>();
  PreparedJob frames;
  for (const v1::Frame& frame : job.frames()) {
    frames.frames.push_back({frame.spec().frame_number(), {}, {}, ""});
  }
  for (const std::string& pattern : {arguments.output, arguments.png}) {
    if (frames.frames.size() < 2 || pattern.empty() || IsPattern(pattern)) continue;
    return absl::InvalidArgumentError(absl::StrCat(pattern, ": the job has ", frames.frames.size(),
                                                   " frames; put #### where the number goes"));
  }
  arguments.scene = job.title();
  return OutputPaths(arguments, frames);
}

absl::StatusOr<v1::Job> FollowJob(FarmClient* client, const std::string& name, bool json) {
  ProgressLine line;
  return client->WatchJob(name, [&](const v1::Job& job) {
    if (json) {
      std::printf("%s\n", JobJson(job).c_str());
      std::fflush(stdout);
    } else {
      line.Show(job.name(), ShareDone(job.progress()), FormatProgress(job));
    }
  });
}

absl::Status SavePictures(FarmClient* client, const v1::Job& job,
                          const std::vector<PicturePaths>& paths, const ViewTransform& view) {
  for (size_t i = 0; i < paths.size() && i < static_cast<size_t>(job.frames_size()); ++i) {
    const absl::Status status =
        SavePicture(client, job.frames(static_cast<int>(i)), paths[i], view);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

ExitCode ReportEnd(const v1::Job& job, bool pictures_written) {
  if (job.state() == v1::Job::STATE_CANCELLED) {
    std::fprintf(stderr, "sheaf: %s was cancelled\n", job.name().c_str());
    return ExitCode::kCancelled;
  }
  if (job.state() == v1::Job::STATE_FAILED) {
    std::fprintf(stderr, "sheaf: %s failed: %s\n", job.name().c_str(), job.failure().c_str());
    return ExitCode::kFailed;
  }
  // A single picture's line, printed when it was written, has told the same.
  const bool told = pictures_written && job.frames_size() == 1;
  if (!told) std::fprintf(stderr, "sheaf: %s\n", FormatJobSummary(job).c_str());
  return ExitCode::kOk;
}

ExitCode FollowToTheEnd(FarmClient* client, const std::string& name, bool json,
                        const std::vector<PicturePaths>& paths, const ViewTransform& view) {
  const absl::StatusOr<v1::Job> job = FollowJob(client, name, json);
  if (absl::IsCancelled(job.status())) {
    std::fprintf(stderr,
                 "sheaf: %s goes on without you; watch it with: sheaf watch %s; end it with: "
                 "sheaf cancel %s\n",
                 name.c_str(), name.c_str(), name.c_str());
    return ExitCode::kInterrupted;
  }
  if (!job.ok()) return ReportCallError(job.status());
  if (job->state() == v1::Job::STATE_SUCCEEDED) {
    const absl::Status saved = SavePictures(client, *job, paths, view);
    if (absl::IsCancelled(saved) || absl::IsUnavailable(saved)) return ReportCallError(saved);
    if (!saved.ok()) return ReportError(ExitCode::kFile, saved);
  }
  return ReportEnd(*job, !paths.empty());
}

}  // namespace sheaf::cli
