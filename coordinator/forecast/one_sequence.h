// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// OneSequenceGain: the price of reliable error bars. They are estimated from the spread of
// kReplicateCount independent sequences of samples, while a single sequence of as many samples
// (FrameSettings::one_sequence) has a smaller error. The smoother an image, the larger the
// difference; see docs/adr/0025-one-sequence-on-request.md.
#pragma once

#include <span>

#include "coordinator/core/frame/sample_rounds.h"

namespace sheaf::coordinator {

// Smaller gains are not reported.
inline constexpr double kOneSequenceGainMin = 1.1;

// The relMSE of an image over the relMSE that it would have with one sequence, estimated from its
// error curve. If errors fall as 1 / n^b, kReplicateCount sequences have kReplicateCount^(b - 1)
// times the error of one sequence of the same total length. b is taken from the last samples of the
// sequences. If b falls in longer sequences, for example once smooth areas have converged and edges
// remain, the gain falls too. Returns 0 unless the gain exceeds kOneSequenceGainMin with 95 %
// confidence. points: the error curve, with cells, of a frame without a stop rule, ascending by
// samples.
double OneSequenceGain(std::span<const RoundRecord> points);

}  // namespace sheaf::coordinator
