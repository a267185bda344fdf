// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MeasuredBrdf: reflection from measured data. Directions of reflection are mapped through the warp
// that samples the distribution of visible micro-normals, after which measured reflectance is
// smooth; spectra are tabulated over the warped domain. Source: Dupuy and Jakob 2018, "An Adaptive
// Parameterization for Efficient Material Acquisition and Rendering".
#pragma once

#include <optional>
#include <vector>

#include "common/base/vector_bytes.h"
#include "common/math/vec.h"
#include "common/scene/formats/measured_file.h"
#include "worker/render/color/wavelengths.h"
#include "worker/render/sampling/warp_table.h"

namespace sheaf::render {

// All directions are local, with z > 0. Thread safety: any number of threads at once.
class MeasuredBrdf {
 public:
  // spectral: keeps the spectra, for Eval at wavelengths; otherwise only the RGB of each value.
  // Requires: data is a result of ReadMeasuredFile.
  MeasuredBrdf(MeasuredData data, bool spectral);

  // f * cos wi, and the pdf of Sample. nm: wavelengths; unused for RGB. Negative RGB components of
  // saturated spectra are set to 0.
  template <typename Color>
  struct Value {
    Color f_cos;
    float pdf = 0;
  };
  template <typename Color>
  Value<Color> Eval(Vec3f wo, Vec3f wi, const Color& nm) const;
  // None where the sampled direction is below the surface.
  std::optional<Vec3f> Sample(Vec3f wo, Vec2f u) const;

  // For light along the normal.
  Rgb albedo() const { return albedo_; }
  uint64_t memory_bytes() const {
    return VectorBytes(phi_, theta_, wavelengths_, rgb_, spectra_) + ndf_.memory_bytes() +
           sigma_.memory_bytes() + vndf_.memory_bytes() + luminance_.memory_bytes();
  }

 private:
  SliceBlend BlendFor(float phi, float theta) const;
  // Looks up a table of `channels` values per slice, at p.
  float LookUp(const std::vector<float>& table, size_t channels, size_t channel,
               const SliceBlend& blend, const CellPosition& cell) const;
  Rgb Reflected(const SliceBlend& blend, const CellPosition& cell, const Rgb& nm) const;
  Spectral Reflected(const SliceBlend& blend, const CellPosition& cell, const Spectral& nm) const;
  void MakeRgb(const std::vector<float>& spectra);
  Rgb MeanReflection() const;

  bool is_isotropic_ = true;
  bool has_jacobian_ = true;
  uint32_t spectra_size_ = 0;
  std::vector<float> phi_, theta_, wavelengths_;
  BilinearGrid ndf_, sigma_;
  WarpTable vndf_, luminance_;
  std::vector<float> rgb_;      // [phi][theta][3][v][u].
  std::vector<float> spectra_;  // [phi][theta][wavelength][v][u]; empty for RGB.
  Rgb albedo_;
};

}  // namespace sheaf::render
