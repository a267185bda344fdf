// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PlanStudy: how many tiles, samples and light passes a study renders in its time. A pure function
// of measured costs.
#pragma once

#include <cstddef>
#include <cstdint>

#include "absl/status/statusor.h"
#include "cli/study/study_crops.h"

namespace sheaf::cli {

// Fractions of a study's time; the rest is for compiling scenes.
inline constexpr double kReferenceFraction = 0.27, kLadderFraction = 0.36, kCropsFraction = 0.08,
                        kPathsFraction = 0.08, kEffectsFraction = 0.15;
// With fewer tiles their spread is a poor estimate.
inline constexpr size_t kStudyTilesMin = 24;
inline constexpr size_t kStudyTilesMax = 2048;
// Blocks of each setting (study_tiles.h); powers of two.
inline constexpr uint64_t kStudyBlocksMin = 4, kStudyBlocksMax = 64;
// The pixels of a smaller frame on which light passes are measured, at least.
inline constexpr int64_t kLightPixelsMin = 1 << 8;

// Seconds are wall time on all threads of the study.
struct StudyCosts {
  double minutes = 0;           // Duration of the study.
  double seconds_per_tile = 0;  // For a block of a tile, without light paths.
  double seconds_per_light_path = 0;
  int64_t frame_pixels = 0;        // The whole frame's: the light paths of one of its passes.
  size_t tile_count = 0;           // In the window.
  size_t setting_count = 0;        // Settings that are rendered,
  size_t light_setting_count = 0;  // and those of them that have light paths.
};

struct StudyPlan {
  size_t tile_count = 0;
  uint64_t blocks = 0, reference_blocks = 0;
  CropPlan crops;
  // How many times smaller than the frame the one is on which light passes are measured; and the
  // blocks of passes of the frame itself for the reference. 0 without light paths.
  int32_t shrink = 0;
  uint64_t light_reference_blocks = 0;
};

// A setting's light paths cost about as many paths as its samples: its frame has about as many
// pixels as the tiles together. Half of the reference's time is for light passes of the frame
// itself. Errors: kResourceExhausted, with the minutes to
// give, if the time is too short for a few tiles, or for a block of light passes of the frame.
absl::StatusOr<StudyPlan> PlanStudy(const StudyCosts& costs);

// The shrink at which a frame has about this many pixels, but not fewer than kLightPixelsMin; at
// least 1.
int32_t ShrinkTo(double pixels, int64_t frame_pixels);

}  // namespace sheaf::cli
