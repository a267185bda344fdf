// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The normal distribution of mean 0 and standard deviation 1.
#pragma once

namespace sheaf {

// Cumulative probability at this many deviations. For the upper tail, pass the negative: small
// probabilities lose no precision.
double NormalCdf(double deviations);

// Inverse of NormalCdf. Requires: 0 < probability < 1.
double NormalQuantile(double probability);

}  // namespace sheaf
