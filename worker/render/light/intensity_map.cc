// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/intensity_map.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {

absl::StatusOr<IntensityMap> IntensityMap::Make(int size, std::vector<float> texels) {
  IntensityMap map;
  map.size_ = size;
  double sum = 0;
  for (size_t i = 0; i < texels.size(); ++i) {
    if (!(texels[i] >= 0 && std::isfinite(texels[i]))) {
      const auto width = static_cast<size_t>(size);
      return absl::InvalidArgumentError(
          absl::StrCat("texel (", i % width, ", ", i / width, ") is ", texels[i],
                       ", but light must be finite and not negative"));
    }
    sum += static_cast<double>(texels[i]);
    map.peak_ = std::max(map.peak_, texels[i]);
  }
  map.mean_ = sum / static_cast<double>(texels.size());
  map.texels_ = std::move(texels);
  return map;
}

float IntensityMap::At(Vec3f d) const {
  const Vec2f st = EqualAreaSphereToSquare(d);
  // NaN fails the comparison and selects the first texel.
  const auto index = [&](float s) {
    return s > 0 ? std::min(static_cast<int>(s * static_cast<float>(size_)), size_ - 1) : 0;
  };
  return texels_[static_cast<size_t>(index(st.y)) * static_cast<size_t>(size_) +
                 static_cast<size_t>(index(st.x))];
}

}  // namespace sheaf::render
