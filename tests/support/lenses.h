// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lenses for tests.
#pragma once

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "worker/render/camera/lens_system.h"

namespace sheaf::testing {

inline LensDescription Lens(std::vector<LensSurface> surfaces) {
  LensDescription lens;
  lens.surfaces = std::move(surfaces);
  lens.aperture_diameter_mm = 1000;
  return lens;
}

// Double Gauss, f/2, 100 mm: US patent 2,673,491 (Tronnier 1954), as in Smith, Modern Lens Design.
inline LensDescription DoubleGauss() {
  return Lens({{58.950, 7.520, 1.670, 50.4},
               {169.660, 0.240, 1, 50.4},
               {38.550, 8.050, 1.670, 46.0},
               {81.540, 6.550, 1.699, 46.0},
               {25.500, 11.410, 1, 36.0},
               {0, 9.000, 1, 34.2},
               {-28.990, 2.360, 1.603, 34.0},
               {81.540, 12.130, 1.658, 40.0},
               {-40.770, 0.380, 1, 40.0},
               {874.130, 6.440, 1.717, 40.0},
               {-79.460, 72.228, 1, 40.0}});
}

inline render::LensSystem MakeLens(const LensDescription& description) {
  absl::StatusOr<render::LensSystem> lens = render::LensSystem::Make(description, {});
  EXPECT_TRUE(lens.ok()) << lens.status();
  return lens.ok() ? *std::move(lens) : *render::LensSystem::Make(DoubleGauss(), {});
}

}  // namespace sheaf::testing
