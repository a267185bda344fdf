// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/summary.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/progress_line.h"

namespace sheaf::cli {
namespace {

double Seconds(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + duration.nanos() * 1e-9;
}

std::string FormatCosts(const v1::Progress& progress) {
  const double wall_seconds = Seconds(progress.wall_duration());
  std::string text = absl::StrFormat("%.1f s", wall_seconds);
  if (wall_seconds > 0) {
    const auto rate = [&](uint64_t count) {
      return FormatCount(static_cast<double>(count) / wall_seconds);
    };
    absl::StrAppend(&text, ", ", rate(progress.sample_count_done()), " samples/s, ",
                    rate(progress.ray_count()), " rays/s");
  }
  if (progress.relative_mse() > 0) {
    absl::StrAppend(&text, absl::StrFormat(", relMSE %.1e", progress.relative_mse()));
  }
  absl::StrAppend(&text, ", ", progress.nonfinite_count(), " non-finite");
  if (progress.nonfinite_count() > 0) text += " (a defect, please report it)";
  return text;
}

}  // namespace

std::string FormatPictureSummary(const v1::Frame& frame, const PicturePaths& paths) {
  const v1::FrameSettings& settings = frame.spec().settings();
  const v1::PixelRect& window = settings.window();
  const std::string bias = settings.similarity_after_count() == 0
                               ? std::string()
                               : absl::StrCat(", biased: similarity after ",
                                              settings.similarity_after_count(), " scatterings");
  return absl::StrCat(paths.exr, paths.png.empty() ? "" : " and ", paths.png, ": ",
                      window.x1_px() - window.x0_px(), "x", window.y1_px() - window.y0_px(), ", ",
                      settings.sample_count(),
                      settings.sample_count() == 1 ? " sample" : " samples", bias, ", ",
                      FormatCosts(frame.progress()));
}

std::string FormatJobSummary(const v1::Job& job) {
  return absl::StrCat(job.name(), ": ", job.frames_size(),
                      job.frames_size() == 1 ? " frame, " : " frames, ",
                      FormatCosts(job.progress()));
}

}  // namespace sheaf::cli
