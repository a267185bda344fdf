// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Principled Bsdfs for tests, made from descriptions by the material table.
#pragma once

#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "tests/support/bsdf_fixtures.h"
#include "worker/render/material/material.h"

namespace sheaf::testing {

inline PrincipledMaterial WhitePrincipled() {
  PrincipledMaterial material;
  material.base_color.value.rgb = material.specular_tint.value.rgb = Rgb::Gray(1);
  return material;
}

// The table lives as long as the fixture.
inline BsdfFixture MakePrincipledFixture(const PrincipledMaterial& material,
                                         const std::string& name = "principled",
                                         bool single_scattering = false) {
  SceneDescription scene;
  scene.materials.emplace_back().material = material;
  TableFileSource files{{}};
  render::MaterialOptions options;
  options.single_scattering = single_scattering;
  auto table = render::MaterialTable::Build(scene, files, options);
  EXPECT_TRUE(table.ok()) << table.status();
  if (!table.ok()) return {name, {}, nullptr};
  std::shared_ptr<const render::MaterialTable> shared = *std::move(table);
  return {name, shared->Evaluate<render::kAllTraits>(0, {}, 0), shared};
}

}  // namespace sheaf::testing
