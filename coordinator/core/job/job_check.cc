// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/job_check.h"

#include <bit>
#include <string>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "common/film/light/light_part_size.h"
#include "common/scene/settings/chain_settings.h"
#include "common/scene/settings/path_shares.h"
#include "common/scene/settings/sample_bound.h"
#include "common/scene/settings/stereo.h"
#include "coordinator/core/job/cell_grid.h"

namespace sheaf::coordinator {
namespace {

absl::Status CheckPartition(const Partition& p, const Limits& limits) {
  if (p.tile_size_px < 1 || p.tile_size_px > limits.frame_edge_px_max) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a tile size of ", p.tile_size_px, " px is outside 1 to ", limits.frame_edge_px_max));
  }
  if (p.cell_size_px != 0 && !DividesIntoCells(p.tile_size_px, p.cell_size_px)) {
    return absl::InvalidArgumentError(absl::StrCat("a cell size of ", p.cell_size_px,
                                                   " px does not divide tiles of ", p.tile_size_px,
                                                   " px into at most ", kTileCellsMax));
  }
  if (!std::has_single_bit(p.pass_sample_count) || p.pass_sample_count > limits.samples_max) {
    return absl::InvalidArgumentError(
        absl::StrCat("samples of a pass: ", p.pass_sample_count, " is not a power of two"));
  }
  if (p.lease_pass_count != 0 && (!std::has_single_bit(p.lease_pass_count) ||
                                  p.lease_pass_count > limits.lease_pass_count_max)) {
    return absl::InvalidArgumentError(absl::StrCat("passes of a lease: ", p.lease_pass_count,
                                                   " is not a power of two up to ",
                                                   limits.lease_pass_count_max));
  }
  return absl::OkStatus();
}

int64_t DivideUp(int64_t number, int64_t divisor) { return (number + divisor - 1) / divisor; }

int64_t SquaresOf(const PixelRect& window, int64_t edge_px) {
  return DivideUp(window.Width(), edge_px) * DivideUp(window.Height(), edge_px);
}

// The size of a part of passes of the whole frame: of light passes, or of those of shared paths.
uint64_t PassBytes(const FrameSettings& settings, uint64_t passes) {
  const int64_t pixels = settings.window.PixelCount();
  if (!HasOneTile(settings)) return LightPartBytes(pixels, LightOutputsOf(settings), passes);
  const uint64_t planes = kFilmChannelCount + passes * kReplicateChannelCount;
  return static_cast<uint64_t>(pixels) * planes * sizeof(float);
}

// The error in a frame; empty if there is none.
std::string WhyNot(const FrameSpec& frame, const Partition& partition, const Limits& limits) {
  const FrameSettings& s = frame.settings;
  if (s.width_px < 1 || s.height_px < 1 || s.width_px > limits.frame_edge_px_max ||
      s.height_px > limits.frame_edge_px_max) {
    return absl::StrCat("a size of ", s.width_px, " x ", s.height_px, " px is outside 1 to ",
                        limits.frame_edge_px_max);
  }
  const PixelRect& w = s.window;
  if (w.IsEmpty() || !PixelRect{0, 0, s.width_px, s.height_px}.Contains(w)) {
    return "the window is empty or reaches beyond the frame";
  }
  if (w.PixelCount() > limits.frame_pixels_max) {
    return absl::StrCat(w.PixelCount(), " pixels are more than the limit of ",
                        limits.frame_pixels_max,
                        "; render fewer, or parts of the frame with --crop");
  }
  if (s.samples < 1 || s.samples > limits.samples_max) {
    return absl::StrCat(s.samples, " samples per pixel are outside 1 to ", limits.samples_max);
  }
  if (s.samples > limits.frame_samples_max / PathsPerSample(s)) {
    return absl::StrCat(w.PixelCount(), " pixels with ", s.samples,
                        " samples each are more than the limit of ", limits.frame_samples_max,
                        " samples; request fewer, or a target error");
  }
  if (s.max_depth < 0) return "the depth is negative";
  if (HasLightPasses(s) && LightPassesMax(s, limits) == 0) {
    return absl::StrCat(w.PixelCount(), " pixels: a light pass of them can take ",
                        PassBytes(s, 1) >> 20,
                        " MiB, more than the limit of ", limits.light_part_bytes_max >> 20,
                        "; render parts of the frame with --crop, request fewer outputs, or use "
                        "--techniques ",
                        s.techniques.Without(Technique::kLightPaths).Name());
  }
  if (s.IsStereo()) {
    if (const std::string why_not = WhyNoStereo(s); !why_not.empty()) return why_not;
  }
  if (HasOneTile(s)) {
    if (absl::Status status = CheckSharing(s); !status.ok()) return std::string(status.message());
    if (absl::Status status = CheckChains(s); !status.ok()) return std::string(status.message());
    if (LightPassesMax(s, limits) == 0) {
      return absl::StrCat(w.PixelCount(), " pixels", s.IsStereo() ? " of both eyes" : "",
                          ": a pass of them can take ", PassBytes(s, 1) >> 20,
                          " MiB, more than the limit of ", limits.light_part_bytes_max >> 20,
                          "; render a smaller image");
    }
  }
  for (const auto& [edge_px, most, what] :
       {std::tuple{TileSizeOf(frame, partition), limits.tiles_per_frame_max, "tiles"},
        std::tuple{CellSizeOf(frame, partition), limits.cells_per_frame_max, "cells"}}) {
    if (SquaresOf(w, edge_px) > most) {
      return absl::StrCat(what, " of ", edge_px, " px: ", SquaresOf(w, edge_px),
                          " are more than the limit of ", most, "; use larger ones");
    }
  }
  if (const SampleBound bound = SampleBoundOf(frame.settings);
      frame.stop.certified && !bound.most.has_value()) {
    return absl::StrCat("its error cannot be certified: ", bound.reason);
  }
  return "";
}

// The fewest leases that can render the frame.
int64_t TaskCountMin(const FrameSpec& frame, const Partition& partition, const Limits& limits) {
  const auto samples = static_cast<int64_t>(frame.settings.samples);
  if (HasOneTile(frame.settings)) {
    return DivideUp(samples, static_cast<int64_t>(LightPassesMax(frame.settings, limits)));
  }
  const uint64_t passes =
      partition.lease_pass_count != 0 ? partition.lease_pass_count : limits.lease_pass_count_max;
  const auto lease_samples = static_cast<int64_t>(partition.pass_sample_count * passes);
  const int64_t light_tasks =
      HasLightPasses(frame.settings)
          ? DivideUp(samples, static_cast<int64_t>(LightPassesMax(frame.settings, limits)))
          : 0;
  return SquaresOf(frame.settings.window, partition.tile_size_px) *
             DivideUp(samples, lease_samples) +
         light_tasks;
}

}  // namespace

uint64_t LightPassesMax(const FrameSettings& settings, const Limits& limits) {
  const auto fits = [&](uint64_t passes) {
    return PassBytes(settings, passes) <= limits.light_part_bytes_max;
  };
  uint64_t passes = limits.light_pass_count_max;
  while (passes > 0 && !fits(passes)) passes /= 2;
  return passes;
}

absl::Status CheckJobSpec(const JobSpec& spec, const Limits& limits) {
  if (spec.frames.empty()) return absl::InvalidArgumentError("a job needs at least one frame");
  if (spec.frames.size() > static_cast<size_t>(limits.frames_per_job_max)) {
    return absl::ResourceExhaustedError(
        absl::StrCat(spec.frames.size(), " frames are more than the limit of ",
                     limits.frames_per_job_max, "; submit them as several jobs"));
  }
  if (absl::Status status = CheckPartition(spec.partition, limits); !status.ok()) return status;
  uint64_t sample_count = 0;
  int64_t task_count = 0;
  for (size_t i = 0; i < spec.frames.size(); ++i) {
    const FrameSpec& frame = spec.frames[i];
    if (i > 0 && spec.frames[i - 1].frame_number >= frame.frame_number) {
      return absl::InvalidArgumentError(
          absl::StrCat("frame number ", frame.frame_number, " is repeated or out of order"));
    }
    const std::string why_not = WhyNot(frame, spec.partition, limits);
    if (!why_not.empty()) {
      return absl::InvalidArgumentError(absl::StrCat("frame ", frame.frame_number, ": ", why_not));
    }
    sample_count += PathsPerSample(frame.settings) * frame.settings.samples;
    task_count += TaskCountMin(frame, spec.partition, limits);
    if (sample_count > limits.job_samples_max) {
      return absl::InvalidArgumentError(absl::StrCat(
          "the frames up to ", frame.frame_number, " have more than ", limits.job_samples_max,
          " samples, the limit of a job; request fewer, or submit the frames as several jobs"));
    }
    if (task_count > limits.job_tasks_max) {
      return absl::InvalidArgumentError(absl::StrCat(
          "the frames up to ", frame.frame_number, " make more than ", limits.job_tasks_max,
          " tasks, the limit of a job; use larger tiles, more ",
          "samples per pass or more passes per lease, or submit them as several jobs"));
    }
  }
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
