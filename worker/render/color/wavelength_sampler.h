// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WavelengthSampler: samples the wavelengths of paths. Where lights or materials of the scene have
// narrow bands, one of a path's four wavelengths falls into them: Wavelengths::Sample alone would
// meet a line of .2 nm once in thousands of paths.
#pragma once

#include <vector>

#include "common/scene/scene_description.h"
#include "common/scene/spectrum/narrow_bands.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

class WavelengthSampler {
 public:
  WavelengthSampler() = default;
  // spectra: each has the same weight. Those without bands have none.
  explicit WavelengthSampler(const std::vector<std::vector<NarrowBand>>& spectra);

  // u in [0, 1). Equals Wavelengths::Sample if there are no bands.
  Wavelengths Sample(float u) const {
    return parts_.empty() ? Wavelengths::Sample(u) : SampleBands(u);
  }

  // The part of the wavelengths that falls into bands.
  static constexpr float kBandShare = 1.0f / kWavelengthCount;

 private:
  // A part of a band, with even density; parts do not overlap.
  struct Part {
    double first_nm, last_nm;
    double probability;  // The sum of this part and those before.
    double pdf;          // Per nm.
  };
  Wavelengths SampleBands(float u) const;
  double PdfInBands(double nm) const;

  std::vector<Part> parts_;
};

// The narrow bands of each color of the scene that has some.
std::vector<std::vector<NarrowBand>> NarrowBandsOf(const SceneDescription& scene);

}  // namespace sheaf::render
