// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/summary.h"

#include <algorithm>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/duration.h"
#include "cli/error_text.h"
#include "cli/progress_line.h"
#include "common/scene/settings/techniques.h"
#include "coordinator/core/frame/sample_rounds.h"

namespace sheaf::cli {
namespace {

// Further lines of a message are indented.
constexpr char kNextLine[] = "\n  ";

// The wall time and the error; those of Detail::kAll add rates and FLIP. flip: 0 if unknown.
// rendered: as IsRendered; other frames have no sampling rate.
std::string FormatCosts(const v1::Progress& progress, double flip, bool rendered, Detail detail) {
  const double wall_seconds = Seconds(progress.wall_duration());
  std::string text = absl::StrFormat("%.1f s", wall_seconds);
  const bool says_all = detail == Detail::kAll;
  if (says_all && wall_seconds > 0) {
    const auto rate = [&](uint64_t count) {
      return FormatCount(static_cast<double>(count) / wall_seconds);
    };
    if (rendered) absl::StrAppend(&text, ", ", rate(progress.sample_count_done()), " samples/s");
    absl::StrAppend(&text, ", ", rate(progress.ray_count()), " rays/s");
  }
  if (progress.relative_mse() > 0) {
    absl::StrAppend(&text, ", error ", FormatBothErrors(progress.relative_mse()));
  }
  if (says_all && flip > 0) absl::StrAppend(&text, absl::StrFormat(", FLIP %.2g", flip));
  if (progress.nonfinite_count() > 0) {
    absl::StrAppend(&text, ", ", progress.nonfinite_count(),
                    " samples not finite (a defect, please report it)");
  }
  return text;
}

// Whether all of its samples were rendered by this job, and none came with an image.
bool IsRendered(const v1::Frame& frame) { return !frame.spec().has_resumed_image(); }

std::string FormatSamples(const v1::Frame& frame) {
  const v1::FrameSettings& settings = frame.spec().settings();
  if (!frame.spec().has_stop()) {
    return absl::StrCat(settings.sample_count(),
                        settings.sample_count() == 1 ? " sample" : " samples");
  }
  const v1::PixelRect& window = settings.window();
  const double pixel_count =
      1.0 * (window.x1_px() - window.x0_px()) * (window.y1_px() - window.y0_px());
  // The last round counts camera samples; the progress counts light paths, too.
  const uint64_t sample_count = frame.rounds().empty() ? frame.progress().sample_count_done()
                                                       : frame.rounds().rbegin()->sample_count();
  return absl::StrFormat("%.1f samples on average",
                         static_cast<double>(sample_count) / pixel_count);
}

// The result of a rule that asks for a certified error. estimated: the bound by the estimate.
std::string FormatCertified(const v1::Frame& frame, double target, const std::string& estimated) {
  const v1::Round& last = *frame.rounds().rbegin();
  const double certified = last.certified_relative_mse();
  if (certified > 0 && certified <= target) {
    return absl::StrFormat(", certified to be at most %.2g (target: %.2g)", certified, target);
  }
  return absl::StrFormat(
      "; not certified to be at most %.2g: %s, and the certificate says %s; a "
      "smaller --clamp or more pixels tighten it%s",
      target, estimated, certified > 0 ? absl::StrFormat("%.2g", certified) : "nothing",
      frame.stop_reason() == v1::STOP_REASON_TARGET_ERROR ? ", more samples do not"
                                                          : ", and so may more samples");
}

// Whether the requested target was reached.
std::string FormatStop(const v1::Frame& frame) {
  const double target = frame.spec().stop().target_error();
  if (target <= 0 || frame.rounds().empty()) return "";
  const double upper = frame.rounds().rbegin()->relative_mse_upper();
  std::string bound = absl::StrFormat("at most %.2g with 95 %% confidence", upper);
  if (frame.spec().stop().certified()) return FormatCertified(frame, target, bound);
  // Error bars do not include features that no sample has hit.
  constexpr double kHardlyAnyNoise = 0.01;
  if (upper <= kHardlyAnyNoise * target) {
    bound += absl::StrFormat(" (but things that cover less than 1/%.0f of a pixel may be missing)",
                             1 / coordinator::kCoverageSeen);
  }
  switch (frame.stop_reason()) {
    case v1::STOP_REASON_TARGET_ERROR:
      return absl::StrFormat(", %s (target: %.2g)", bound, target);
    case v1::STOP_REASON_TIME:
      return absl::StrFormat("; the time ended before the target of %.2g: %s", target, bound);
    case v1::STOP_REASON_CPU:
      return absl::StrFormat("; the budget ended before the target of %.2g: %s", target, bound);
    default:
      return absl::StrFormat("; all samples were used before the target of %.2g: %s", target,
                             bound);
  }
}

// The warning concerns the pixels of such tiles; the error of the whole image already includes
// them. It matters where the frame was to stop at an error, or where layers that tell the cause
// were asked for.
std::string FormatReliability(const v1::Frame& frame, Detail detail) {
  if (frame.unreliable_tile_count() == 0) return "";
  if (detail == Detail::kShort && frame.spec().stop().target_error() <= 0 &&
      frame.unreliable_layers().empty()) {
    return "";
  }
  std::string text = absl::StrFormat(
      "; %d of %d tiles contain fireflies, so error bars of their pixels may be "
      "too small: more samples help",
      frame.unreliable_tile_count(), frame.tile_count());
  if (frame.unreliable_layers().empty()) {
    return text + " (--light-paths or sheaf study identify the light responsible)";
  }
  text += "; main cause: ";
  for (const v1::UnreliableLayer& layer : frame.unreliable_layers()) {
    const bool is_first = &layer == &frame.unreliable_layers(0);
    absl::StrAppend(&text, is_first ? "" : ", then ", layer.layer(), " (", layer.tile_count(),
                    layer.tile_count() == 1 ? " tile)" : " tiles)");
  }
  return text;
}

// The cost of true error bars in a smooth image, and the alternative.
std::string FormatOneSequence(const v1::Frame& frame, Detail detail) {
  if (detail == Detail::kShort || frame.one_sequence_gain() <= 0) return "";
  return absl::StrFormat(
      "; the image is smooth: --one-sequence would reduce its relMSE about %.1fx, but gives no "
      "true error bars (sheaf study measures it)",
      frame.one_sequence_gain());
}

// The bias of the image against the scene's light, if any.
std::string FormatBias(const v1::FrameSettings& settings) {
  std::string bias;
  if (settings.similarity_after_count() != 0) {
    bias = absl::StrCat(", biased: similarity after ", settings.similarity_after_count(),
                        " scatterings");
  }
  const std::optional<TechniqueSet> techniques = TechniqueSet::FromNumber(settings.techniques());
  if (techniques && MergesLightPaths(*techniques)) {
    absl::StrAppend(&bias, ", biased: light paths merged; errors include the bias");
  }
  if (settings.max_component_value() != 0) {
    absl::StrAppend(&bias, ", biased: samples clamped to ", settings.max_component_value());
  }
  return bias;
}

}  // namespace

std::string FormatEyeErrors(const v1::Frame& frame) {
  if (frame.left_eye_relative_mse() <= 0 && frame.right_eye_relative_mse() <= 0) return "";
  return absl::StrCat("error ", FormatPixelError(frame.left_eye_relative_mse()),
                      " of the left eye, ", FormatPixelError(frame.right_eye_relative_mse()),
                      " of the right, ", FormatPixelError(frame.eye_difference_relative_mse()),
                      " of their difference");
}

std::string FormatImageSummary(const v1::Frame& frame, const ImagePaths& paths, Detail detail) {
  const v1::FrameSettings& settings = frame.spec().settings();
  const v1::PixelRect& window = settings.window();
  const std::string eyes = FormatEyeErrors(frame);
  return absl::StrCat("frame ", frame.spec().frame_number(), ": ", window.x1_px() - window.x0_px(),
                      "x", window.y1_px() - window.y0_px(), ", ", FormatSamples(frame),
                      FormatBias(settings), kNextLine,
                      FormatCosts(frame.progress(), frame.flip(), IsRendered(frame), detail),
                      eyes.empty() ? "" : "; ", eyes, FormatStop(frame),
                      FormatReliability(frame, detail), FormatOneSequence(frame, detail), kNextLine,
                      "written to ", paths.exr, paths.png.empty() ? "" : " and ", paths.png);
}

std::string FormatJobSummary(const v1::Job& job, Detail detail) {
  return absl::StrCat(
      job.name(), ": ", job.frames_size(), job.frames_size() == 1 ? " frame, " : " frames, ",
      FormatCosts(job.progress(), /*flip=*/0,
                  std::all_of(job.frames().begin(), job.frames().end(), IsRendered), detail));
}

}  // namespace sheaf::cli
