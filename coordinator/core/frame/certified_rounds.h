// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The rounds of a frame whose rule asks for a certified error (StopRule::certified).
//
// A certificate (common/film/error/certificate.h) holds if the number of samples of a pixel does
// not depend on its samples. So all pixels have the same number, one of a fixed list, which the
// certificate's probability of a miss is divided among; which of them are looked at may depend on
// anything. A frame ends at the first certified bound that is not above the target.
#pragma once

#include "coordinator/core/frame/sample_rounds.h"

namespace sheaf::coordinator {

// The certified bound exceeds the estimate by an amount that hardly falls with more samples. If
// that alone is above the target, the frame ends where the estimated bound reaches the target;
// otherwise also where that bound is at most this fraction of the target. Either way more pixels or
// a smaller maximum of a sample would help, not more samples.
inline constexpr double kCertificateOutOfReach = 0.25;

// As DecideRound, for a rule that asks for a certified error. certified_upper: of the merged image;
// 0 if it has none.
RoundDecision DecideCertifiedRound(const StopRule& rule, uint64_t samples_max, int round,
                                   double certified_upper, std::span<const CellRound> cells,
                                   std::span<const CellRound> before,
                                   const RoundAllowance& allowance);

}  // namespace sheaf::coordinator
