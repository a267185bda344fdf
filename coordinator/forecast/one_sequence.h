// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The price of true error bars: they are the spread of kReplicateCount independent sequences of
// samples, and one sequence of as many (FrameSettings::one_sequence) has less error. The smoother a
// image, the higher the price; docs/adr/0025-one-sequence-on-request.md.
#pragma once

#include <span>

#include "coordinator/core/sample_rounds.h"

namespace sheaf::coordinator {

// Smaller gains are not told.
inline constexpr double kOneSequenceGainMin = 1.1;

// relMSE of an image over what it would be with one sequence, as its curve tells. Where errors
// fall as 1 / n^b, kReplicateCount sequences have kReplicateCount^(b - 1) times the error of one
// that is as long as they together. b is that of the last samples of each; where it becomes less
// in longer sequences, as where smooth areas are done and edges are left, so is the gain. 0 unless
// it is, with 95 % confidence, above kOneSequenceGainMin. points: of a frame without a stop rule,
// ascending, with their cells.
double OneSequenceGain(std::span<const RoundRecord> points);

}  // namespace sheaf::coordinator
