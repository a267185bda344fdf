// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/follow_job.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <map>
#include <mutex>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/job_json.h"
#include "cli/picture_identity.h"
#include "cli/progress_line.h"
#include "cli/tone_map.h"
#include "common/base/file.h"
#include "common/film/exr_codec.h"
#include "common/image/image_io.h"

namespace sheaf::cli {
namespace {

constexpr size_t kUploadsMax = 4;  // At the same time; hides the way of many small files.
constexpr uint64_t kShownUploadBytesMin = uint64_t{4} << 20;  // Less is over before it is read.
constexpr uint64_t kPictureBytesMax = uint64_t{16} << 30;

// Bytes sent so far, shown.
class UploadProgress {
 public:
  explicit UploadProgress(uint64_t total_bytes)
      : total_bytes_(std::max<uint64_t>(total_bytes, 1)) {}
  void Add(uint64_t size_bytes) {
    const std::lock_guard<std::mutex> lock(mutex_);
    sent_bytes_ += size_bytes;
    if (total_bytes_ < kShownUploadBytesMin) return;
    const double share =
        std::min(1.0, static_cast<double>(sent_bytes_) / static_cast<double>(total_bytes_));
    line_.Show("uploading", share,
               absl::StrFormat("%.0f %% of %sB", 100 * share,
                               FormatCount(static_cast<double>(total_bytes_))));
  }

 private:
  std::mutex mutex_;
  ProgressLine line_;
  const uint64_t total_bytes_;
  uint64_t sent_bytes_ = 0;
};

double Seconds(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + duration.nanos() * 1e-9;
}

absl::Status SavePicture(FarmClient* client, const v1::Frame& frame, const PicturePaths& paths) {
  const absl::StatusOr<std::string> bytes = client->ReadFrameOutput(frame.name(), kPictureBytesMax);
  if (!bytes.ok()) return bytes.status();
  if (absl::Status status = WriteFileAtomically(paths.exr, *bytes); !status.ok()) return status;
  const absl::StatusOr<FramePicture> picture = ReadPicture(paths.exr);
  if (!picture.ok()) return picture.status();
  if (PictureIdentity(*picture) != frame.picture_digest()) {
    return absl::DataLossError(absl::StrCat(
        paths.exr,
        ": is not the picture the coordinator delivered; fetch it again with sheaf watch"));
  }
  std::fprintf(stderr, "sheaf: wrote %s\n", paths.exr.c_str());
  if (paths.png.empty()) return absl::OkStatus();
  const PixelRect& window = picture->window;
  absl::Status status = WritePng(paths.png, window.Width(), window.Height(), ToneMapSrgb(*picture));
  if (status.ok()) std::fprintf(stderr, "sheaf: wrote %s\n", paths.png.c_str());
  return status;
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
                          const std::vector<PicturePaths>& paths) {
  for (size_t i = 0; i < paths.size() && i < static_cast<size_t>(job.frames_size()); ++i) {
    const absl::Status status = SavePicture(client, job.frames(static_cast<int>(i)), paths[i]);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

ExitCode ReportEnd(const v1::Job& job) {
  const v1::Progress& progress = job.progress();
  if (job.state() == v1::Job::STATE_CANCELLED) {
    std::fprintf(stderr, "sheaf: %s was cancelled\n", job.name().c_str());
    return ExitCode::kCancelled;
  }
  if (job.state() == v1::Job::STATE_FAILED) {
    std::fprintf(stderr, "sheaf: %s failed: %s\n", job.name().c_str(), job.failure().c_str());
    return ExitCode::kFailed;
  }
  const double wall_seconds = Seconds(progress.wall_duration());
  std::string text = absl::StrFormat(
      "%s: %s in %.1f s, %s samples", job.name(), job.frames_size() == 1 ? "done" : "all done",
      wall_seconds, FormatCount(static_cast<double>(progress.sample_count_done())));
  if (wall_seconds > 0) {
    absl::StrAppend(&text, ", ",
                    FormatCount(static_cast<double>(progress.ray_count()) / wall_seconds),
                    " rays/s");
  }
  if (progress.relative_mse() > 0) {
    absl::StrAppend(&text, absl::StrFormat(", error (relMSE) %.2e", progress.relative_mse()));
  }
  if (progress.nonfinite_count() > 0) {
    absl::StrAppend(&text, "; ", progress.nonfinite_count(),
                    " samples were not finite: a defect, please report it");
  }
  std::fprintf(stderr, "sheaf: %s\n", text.c_str());
  return ExitCode::kOk;
}

ExitCode FollowToTheEnd(FarmClient* client, const std::string& name, bool json,
                        const std::vector<PicturePaths>& paths) {
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
    const absl::Status saved = SavePictures(client, *job, paths);
    if (absl::IsCancelled(saved) || absl::IsUnavailable(saved)) return ReportCallError(saved);
    if (!saved.ok()) return ReportError(ExitCode::kFile, saved);
  }
  return ReportEnd(*job);
}

}  // namespace sheaf::cli
