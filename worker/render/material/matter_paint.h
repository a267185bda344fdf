// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MatterPaint: what is painted on the matter that a path is in: the share of its scattering that is
// left, as MediumTable::MixOf takes it. Set where the path enters. Overlapping matter without a
// rank all has that of the boundary that was entered last. See docs/adr/0050.
#pragma once

namespace sheaf::render {

// Where no matter may be painted it takes no memory.
template <typename Color, bool kPaints>
struct MatterPaint {
  static const Color* OrNull() { return nullptr; }
};
template <typename Color>
struct MatterPaint<Color, true> {
  Color share = Color::Grey(1);
  const Color* OrNull() const { return &share; }
};

}  // namespace sheaf::render
