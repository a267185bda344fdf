// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The normal distribution of mean 0 and deviation 1.
#pragma once

namespace sheaf {

// Share of it that lies below so many deviations, and above.
double NormalShareBelow(double deviations);
double NormalShareAbove(double deviations);

// How many deviations have this share below, or above, them. Requires: 0 < share < 1.
double NormalQuantileBelow(double share);
double NormalQuantileAbove(double share);

}  // namespace sheaf
