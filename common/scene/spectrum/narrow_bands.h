// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Narrow bands: the parts of a measured spectrum that a table in steps of 1 nm misses or widens,
// such as the lines of a sodium lamp, a laser, or a filter for them.
#pragma once

#include <vector>

#include "common/scene/color_spec.h"

namespace sheaf {

// A part of a spectrum that is linear from one end to the other, between two whole nanometers.
struct NarrowBand {
  double first_nm = 0, last_nm = 0;
  double first = 0, last = 0;              // Values of the spectrum at the ends, within.
  double table_first = 0, table_last = 0;  // Values of a table in steps of 1 nm there.

  double At(double nm) const {
    const double part = (nm - first_nm) / (last_nm - first_nm);
    return first * (1 - part) + last * part;
  }
  double Integral() const { return 0.5 * (first + last) * (last_nm - first_nm); }
};

// In ascending order; empty where a table represents the spectrum well enough. Spectra that are not
// given by values have none.
std::vector<NarrowBand> NarrowBandsOf(const ColorSpec& spectrum);

}  // namespace sheaf
