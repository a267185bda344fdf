// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SubsurfaceTexture: the texture on the subsurface medium that a path is in, as the fraction of its
// scattering that is left, which MediumTable::PropertiesOf takes. Set where the path enters.
// Overlapping subsurface media without a rank all use the value of the boundary entered last. See
// docs/adr/0050.
#pragma once

namespace sheaf::render {

// Empty where no subsurface medium can have a texture.
template <typename Color, bool kHasTexture>
struct SubsurfaceTexture {
  static const Color* OrNull() { return nullptr; }
};
template <typename Color>
struct SubsurfaceTexture<Color, true> {
  Color value = Color::Gray(1);
  const Color* OrNull() const { return &value; }
};

}  // namespace sheaf::render
