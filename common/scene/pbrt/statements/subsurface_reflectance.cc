// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/subsurface_reflectance.h"

#include "common/scene/half_space.h"
#include "common/scene/pbrt/statements/color_parameters.h"

namespace sheaf {

void SetReflectance(const SubsurfaceReflectance& reflectance, MediumDescription* medium) {
  const Rgb free_path = reflectance.free_path.rgb * reflectance.scale;
  const Rgb color = reflectance.texture == kNone ? reflectance.color.rgb : Rgb::Gray(1);
  Rgb sigma_a, sigma_s;
  for (size_t c = 0; c < 3; ++c) {
    const double albedo =
        AlbedoForReflectance(static_cast<double>(color[c]), static_cast<double>(reflectance.eta),
                             static_cast<double>(medium->g));
    const double sigma_t = 1 / static_cast<double>(free_path[c]);
    sigma_s[c] = static_cast<float>(albedo * sigma_t);
    sigma_a[c] = static_cast<float>((1 - albedo) * sigma_t);
  }
  medium->scale = 1;
  medium->sigma_a = RgbColor(sigma_a);
  medium->sigma_s = RgbColor(sigma_s);
  medium->reflectance = reflectance;
}

}  // namespace sheaf
