// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Measured spectra as tables. The numbers are facts of physics and standards; spectrum.h converts
// them to colors.
#pragma once

#include <cstddef>

namespace sheaf::spectrum_data {

// CIE 1931 2-degree standard observer at 360, 365 ... 830 nm. Source: CIE 15:2004.
inline constexpr size_t kCmfCount = 95;
inline constexpr double kCmfFirstNm = 360, kCmfStepNm = 5;
extern const double kCmfX[kCmfCount];
extern const double kCmfY[kCmfCount];
extern const double kCmfZ[kCmfCount];

// Components of daylight at 360, 370 ... 830 nm, linear in between. Source: CIE 15:2004, table T.2.
inline constexpr size_t kDaylightCount = 48;
inline constexpr double kDaylightFirstNm = 360, kDaylightStepNm = 10;
extern const double kDaylightS0[kDaylightCount];
extern const double kDaylightS1[kDaylightCount];
extern const double kDaylightS2[kDaylightCount];

// Metals at the photon energies 3.50, 3.45 ... 1.45 eV (354.24 to 855.06 nm).
// Source: measurements of Johnson and Christy 1972 (Cu, Ag, Au) and Rakic 1995 (Al), as collected
// for the luxpop and SOPRA tables that renderers share.
inline constexpr size_t kMetalCount = 42;
inline constexpr double kMetalFirstEv = 3.50, kMetalStepEv = -0.05;
struct Metal {
  const char* name;  // "Cu"
  double eta[kMetalCount];
  double k[kMetalCount];
};
inline constexpr size_t kMetalTableCount = 4;
extern const Metal kMetals[kMetalTableCount];

// CIE illuminants F1 to F12, fluorescent lamps, at 380, 385 ... 780 nm. Source: CIE 15:2004, table
// T.6.
inline constexpr size_t kFluorescentLampCount = 12, kFluorescentCount = 81;
inline constexpr double kFluorescentFirstNm = 380, kFluorescentStepNm = 5;
extern const double kFluorescent[kFluorescentLampCount][kFluorescentCount];

// Any other tabulated spectrum, linear in between. Source of CuZn, brass of 30 % zinc: the luxpop
// and SOPRA tables.
struct Table {
  const char* name;  // As scenes write it.
  size_t count;
  const double* wavelengths_nm;
  const double* values;
};
inline constexpr size_t kTableCount = 13;
extern const Table kTables[kTableCount];

}  // namespace sheaf::spectrum_data
