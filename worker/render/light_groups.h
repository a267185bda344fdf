// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightGroups: what each group of lights contributes to one sample. Where no groups were asked for
// it holds nothing, and does nothing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/film/film_outputs.h"
#include "worker/render/light_table.h"

namespace sheaf::render {

// Color: Rgb, or Spectral at the wavelengths of the path.
template <typename Color>
class LightGroups {
 public:
  // Starts with `count` groups that contribute nothing.
  void Reset(size_t count) { sums_.assign(count, Color{}); }

  void Add(const LightTable& lights, uint32_t light, const Color& radiance) {
    if (!sums_.empty()) sums_[lights.GroupOf(light)] += radiance;
  }
  // The same for `radiance`, which is weight times what all infinite lights together send to p
  // along d.
  void AddSky(const LightTable& lights, Vec3f p, Vec3f d, const WavelengthsOf<Color>& wavelengths,
              const Color& weight, const Color& radiance) {
    if (!sums_.empty()) lights.AddByGroup(p, d, wavelengths, weight, radiance, &sums_);
  }
  // To a group by its index.
  void AddToGroup(uint32_t group, const Color& radiance) {
    if (!sums_.empty()) sums_[group] += radiance;
  }
  // Writes each group's to_rgb(sum) to its channels, the last ones, and starts anew.
  template <typename ToRgb>
  void MoveTo(OutputSample* outputs, const ToRgb& to_rgb) {
    if (sums_.empty()) return;
    size_t mean = outputs->means.size() - 3 * sums_.size();
    for (Color& sum : sums_) {
      const Rgb rgb = to_rgb(sum);
      for (size_t i = 0; i < 3; ++i) outputs->means[mean++] = rgb[i];
      sum = {};
    }
  }

 private:
  std::vector<Color> sums_;
};

}  // namespace sheaf::render
