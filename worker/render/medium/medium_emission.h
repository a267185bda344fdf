// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MediumEmission: the emission of a heterogeneous medium per unit of absorption: one radiance, or
// that of black bodies with the temperatures of a grid, either times the factors of a grid; or the
// colors of a grid. Source: pbrt-v4's GridMedium, RGBGridMedium and NanoVDBMedium.
#pragma once

#include <optional>

#include "common/scene/medium_description.h"
#include "common/volume/volume_grid.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/geometry/affine.h"

namespace sheaf::render {

// Spectral radiance of a black body relative to its peak, in [0, 1]. 0 for temperatures that are
// not positive.
float BlackbodyOfPeakOne(float temperature_k, float wavelength_nm);
// The same as linear sRGB, with negative components set to 0: that of the spectrum per nm, as RgbOf
// converts it. Within 0.1 % of the integral from 500 K to 100000 K; constant above.
Rgb BlackbodyRgbOfPeakOne(float temperature_k);

class MediumEmission {
 public:
  // render_from_medium: invertible. radiance: used where no grid gives temperatures.
  MediumEmission(const Affine& render_from_medium, const ColorSpec& radiance, float scale,
                 bool spectral);
  // Black bodies at (value - offset_k) * scale, where that exceeds 100 K. Requires: a scalar grid.
  void SetTemperatures(VolumeGrid grid, const TemperatureEmission& emission);
  // Factors of the radiance. Requires: a scalar grid.
  void SetFactors(VolumeGrid grid);
  // Radiance as RGB, in place of the constant one. Requires: a grid of vectors.
  void SetColors(VolumeGrid grid);

  // Radiance at a point of render space. Thread safety: any number of threads at once.
  template <typename Color>
  Color At(Vec3d p, const WavelengthsOf<Color>& wavelengths) const;
  uint64_t memory_bytes() const;

 private:
  struct Grid {
    VolumeGrid values;
    Affine index_from_render;
    float At(Vec3d p) const;
    Vec3f VectorAt(Vec3d p) const;
  };
  Grid Placed(VolumeGrid grid) const;

  Affine render_from_medium_;
  std::optional<Grid> temperatures_, factors_, colors_;
  TemperatureEmission emission_;
  float scale_;
  Rgb radiance_;
  SpectralColor spectrum_;
};

}  // namespace sheaf::render
