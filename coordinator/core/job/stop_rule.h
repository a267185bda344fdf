// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// StopRule: the conditions under which a frame is done.
#pragma once

#include <cstdint>

#include "absl/time/time.h"
#include "common/film/error/error_estimate.h"
#include "common/film/film_tile.h"

namespace sheaf::coordinator {

// If no limit is set, each pixel gets FrameSettings::samples; otherwise that is the maximum. The
// frame ends at the first limit that it reaches.
struct StopRule {
  double target_error = 0;                             // relMSE (FrameError) to reach; 0: none.
  absl::Duration time_max = absl::InfiniteDuration();  // Wall time, from the frame's first lease.
  absl::Duration cpu_max = absl::InfiniteDuration();   // CPU time of workers for the frame.
  // The target is compared with the certified bound (certified_rounds.h) in place of the estimated
  // one. Requires a target.
  bool certified = false;
  // Samples per pixel in the first round; more than the default if a frame that was rendered
  // without rounds is refined.
  uint64_t first_round_samples = kReplicateCount;

  // Whether the frame is rendered in rounds (sample_rounds.h).
  bool IsActive() const {
    return target_error > 0 || time_max != absl::InfiniteDuration() ||
           cpu_max != absl::InfiniteDuration();
  }
  friend bool operator==(const StopRule&, const StopRule&) = default;
};

// The largest target error that is accepted.
inline constexpr double kTargetErrorMax = 1e6;
// The default of the maximum samples per pixel in frames with a rule.
inline constexpr uint64_t kStoppedSamplesMax = uint64_t{1} << 16;

// How a finished job continues.
struct Refinement {
  StopRule stop;
  uint64_t samples = 0;  // Per pixel; the maximum if there is a rule; 0: as before.
};

// The limit that ended a frame.
enum class StopReason { kSamples, kTargetError, kTime, kCpu };
inline constexpr int kStopReasonCount = 4;
// Returns "samples", "target-error", "time" or "cpu".
inline const char* StopReasonName(StopReason reason) {
  switch (reason) {
    case StopReason::kSamples:
      return "samples";
    case StopReason::kTargetError:
      return "target-error";
    case StopReason::kTime:
      return "time";
    case StopReason::kCpu:
      return "cpu";
  }
  return "unknown";
}

}  // namespace sheaf::coordinator
