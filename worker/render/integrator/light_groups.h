// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightGroups: the contribution to one sample of each group of lights, or of each kind of light
// path. Does nothing where the film requests neither.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/film/film_outputs.h"
#include "common/film/light_path_kind.h"
#include "worker/render/light/light_table.h"

namespace sheaf::render {

// Color: Rgb, or Spectral at the wavelengths of the path.
template <typename Color>
class LightGroups {
 public:
  // Sets all groups of the outputs to zero.
  void Reset(const FilmOutputs& outputs) {
    sums_.assign(outputs.light_groups.size(), Color{});
    by_path_ = outputs.light_paths;
  }

  void Add(const LightTable& lights, uint32_t light, LightPathKind kind, const Color& radiance) {
    if (sums_.empty()) return;
    sums_[by_path_ ? static_cast<size_t>(kind) : lights.GroupOf(light)] += radiance;
  }
  // Adds `radiance`: weight times the radiance of all infinite lights together that arrives at p
  // from direction d.
  void AddSky(const LightTable& lights, Vec3f p, Vec3f d, const WavelengthsOf<Color>& wavelengths,
              const Color& weight, LightPathKind kind, const Color& radiance) {
    if (sums_.empty()) return;
    if (by_path_) {
      sums_[static_cast<size_t>(kind)] += radiance;
    } else {
      lights.AddByGroup(p, d, wavelengths, weight, radiance, &sums_);
    }
  }
  // Adds emission of media. group: the index of their group.
  void AddMediumEmission(uint32_t group, const Color& radiance) {
    if (sums_.empty()) return;
    sums_[by_path_ ? static_cast<size_t>(LightPathKind::kVolumeEmission) : group] += radiance;
  }
  // Writes to_rgb(sum) of each group to its channels, the last ones, and resets the sums.
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
  bool by_path_ = false;
};

}  // namespace sheaf::render
