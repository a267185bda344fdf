// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Flames: small emissive grids for tests of the sampling of emission.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "common/volume/volume_array.h"
#include "gtest/gtest.h"
#include "worker/render/medium/volume_cells.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render::testing {

// A grid of 6 x 4 x 2 values over the box from 0 to (3, 2, 1), moved to `place`, and its emission.
struct Flame {
  std::optional<HeterogeneousMedium> density;
  std::optional<MediumEmission> emission;
  EmissiveDensity source(Rgb sigma_a = Rgb::Gray(1)) const {
    return {&*density, &*emission, sigma_a};
  }
};
inline absl::StatusOr<VolumeGrid> FlameGrid(const std::vector<float>& values) {
  EXPECT_EQ(values.size(), 48u);
  return VolumeGridFromArray("a", "density", {{6, 4, 2}, {0, 0, 0}, {3, 2, 1}}, values);
}
// factors: of the emission, by cell; empty: 1.
inline Flame MakeFlame(const std::vector<float>& values, const Affine& place,
                       const std::vector<float>& factors = {}) {
  auto grid = FlameGrid(values);
  EXPECT_TRUE(grid.ok()) << grid.status();
  auto density =
      HeterogeneousMedium::FromGrid("a", *std::move(grid), {.render_from_medium = place});
  EXPECT_TRUE(density.ok()) << density.status();
  ColorSpec white;
  white.rgb = Rgb::Gray(1);
  Flame flame;
  flame.density.emplace(*std::move(density));
  flame.emission.emplace(place, white, 1, false);
  if (!factors.empty()) {
    auto of_emission = FlameGrid(factors);
    EXPECT_TRUE(of_emission.ok()) << of_emission.status();
    flame.emission->SetFactors(*std::move(of_emission));
  }
  return flame;
}
// Half of them 0.
inline std::vector<float> Uneven(uint32_t seed) {
  EventStream random({seed, 1, 2, 3});
  std::vector<float> values(48);
  for (float& v : values) {
    const double u = random.Uniform();
    v = u < 0.5 ? 0.0f : static_cast<float>(u * u);
  }
  return values;
}

}  // namespace sheaf::render::testing
