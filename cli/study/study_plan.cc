// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_plan.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "absl/strings/str_format.h"
#include "cli/study/study_tiles.h"

namespace sheaf::cli {
namespace {

// Guess of a setting's mean cost relative to the base; the clock ends the measurement anyway.
constexpr double kSettingCost = 1.1;
// The part of the reference's time for light passes of the frame itself.
constexpr double kLightReferencePart = 0.5;
// Shrinks are rounded up from this fraction: a frame may have half as many pixels again as wanted.
constexpr double kShrinkRounding = 0.75;

constexpr double kPathsOfTile = kStudyBlockSamples * kStudyTilePx * kStudyTilePx;

// Wall seconds of a block of light passes of a frame of `pixels` pixels.
double SecondsPerLightBlock(const StudyCosts& costs, double pixels) {
  return costs.seconds_per_light_path * static_cast<double>(kStudyBlockSamples) * pixels;
}

// Plans the passes of the frame itself, as many as their part of the reference's time allows.
absl::Status PlanLightReference(const StudyCosts& costs, StudyPlan* plan) {
  const double seconds = SecondsPerLightBlock(costs, static_cast<double>(costs.frame_pixels));
  const double whole = kReferenceFraction * 60 * costs.minutes;
  if (seconds > whole) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "%g minutes are too few for light paths, which reach every pixel: %d light passes of the "
        "frame take %.2g s; give --minutes %.0f",
        costs.minutes, kStudyBlockSamples, seconds, std::ceil(costs.minutes * seconds / whole)));
  }
  plan->light_reference_blocks =
      static_cast<uint64_t>(std::clamp(kLightReferencePart * whole / std::max(seconds, 1e-7), 1.0,
                                       static_cast<double>(plan->reference_blocks)));
  return absl::OkStatus();
}

}  // namespace

int32_t ShrinkTo(double pixels, int64_t frame_pixels) {
  const auto all = static_cast<double>(frame_pixels);
  const double most = std::sqrt(all / static_cast<double>(kLightPixelsMin));
  const double shrink = std::min(std::sqrt(all / pixels), most);
  return std::max(1, static_cast<int32_t>(shrink + kShrinkRounding));
}

absl::StatusOr<StudyPlan> PlanStudy(const StudyCosts& costs) {
  const double budget = 60 * costs.minutes;
  const bool has_light = costs.light_setting_count > 0;
  const auto settings = static_cast<double>(costs.setting_count);
  const double light_part = static_cast<double>(costs.light_setting_count) / settings;
  const double light_seconds = light_part * costs.seconds_per_light_path;
  const double seconds_per_tile = costs.seconds_per_tile + kPathsOfTile * light_seconds;
  StudyPlan plan;
  // Number of tiles times blocks per setting.
  const double affordable =
      kLadderFraction * budget / (settings * kSettingCost * std::max(seconds_per_tile, 1e-7));
  plan.blocks = kStudyBlocksMin * 4;
  while (plan.blocks > kStudyBlocksMin &&
         affordable / static_cast<double>(plan.blocks) < kStudyTilesMin) {
    plan.blocks /= 2;
  }
  const double count = affordable / static_cast<double>(plan.blocks);
  if (count < 2) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("%g minutes are too few for this scene: 16 samples of %d x %d pixels "
                        "take %.2g s; give --minutes %.0f",
                        costs.minutes, kStudyTilePx, kStudyTilePx, seconds_per_tile,
                        std::ceil(costs.minutes * kStudyTilesMin / count)));
  }
  plan.tile_count = std::min({static_cast<size_t>(count), kStudyTilesMax, costs.tile_count});
  const auto tiles = static_cast<double>(plan.tile_count);
  const double blocks = affordable / tiles;
  plan.blocks =
      std::clamp(std::bit_floor(static_cast<uint64_t>(blocks)), kStudyBlocksMin, kStudyBlocksMax);
  double reference_seconds = kReferenceFraction * budget;
  double seconds_per_block = costs.seconds_per_tile * tiles;
  if (has_light) {
    plan.shrink = ShrinkTo(tiles * kStudyTilePx * kStudyTilePx, costs.frame_pixels);
    reference_seconds *= 1 - kLightReferencePart;
    if (plan.shrink > 1) seconds_per_block += kPathsOfTile * costs.seconds_per_light_path * tiles;
  }
  plan.reference_blocks = static_cast<uint64_t>(
      std::max(2.0 * static_cast<double>(plan.blocks), reference_seconds / seconds_per_block));
  if (has_light) {
    if (absl::Status status = PlanLightReference(costs, &plan); !status.ok()) return status;
  }
  plan.crops = PlanCrops(kCropsFraction * budget / std::max(costs.seconds_per_tile, 1e-7),
                         has_light ? plan.light_reference_blocks : kCropBlocksMax);
  return plan;
}

}  // namespace sheaf::cli
