// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The normal distribution of mean 0 and deviation 1.
#pragma once

namespace sheaf {

// Share of it that lies below so many deviations; what lies above lies below their negative, and
// that loses nothing where it is small.
double NormalShareBelow(double deviations);

// How many deviations have this share below them. Requires: 0 < share < 1.
double NormalQuantile(double share);

}  // namespace sheaf
