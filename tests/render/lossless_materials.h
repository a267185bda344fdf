// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LosslessMaterials: materials that absorb no light.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/support/test_scene.h"

namespace sheaf::render::testing {

struct NamedMaterial {
  std::string name;
  std::function<int32_t(TestScene&)> add;
};

// White without loss: under a white sky, things made of them vanish.
inline std::vector<NamedMaterial> LosslessMaterials() {
  const auto rough = [](float r) { return RoughnessInput{{r, kNone}, {r, kNone}, false}; };
  const auto metal = [=](float r) {
    ConductorMaterial m;
    m.roughness = rough(r);
    m.has_reflectance = true;
    m.reflectance.value.rgb = Rgb::Gray(1);
    return m;
  };
  return {
      {"diffuse", [](TestScene& t) { return t.Diffuse(Rgb::Gray(1)); }},
      {"mirror", [=](TestScene& t) { return t.AddMaterial(metal(0)); }},
      {"rough metal", [=](TestScene& t) { return t.AddMaterial(metal(0.3f)); }},
      {"rough glass",
       [=](TestScene& t) {
         DielectricMaterial glass;
         glass.roughness = rough(0.3f);
         return t.AddMaterial(glass);
       }},
      {"thin glass", [](TestScene& t) { return t.AddMaterial(ThinDielectricMaterial{}); }},
      {"sheet",
       [](TestScene& t) {
         DiffuseTransmissionMaterial sheet;
         sheet.reflectance.value.rgb = Rgb::Gray(0.25f);
         sheet.transmittance.value.rgb = Rgb::Gray(0.75f);
         return t.AddMaterial(sheet);
       }},
      {"coated metal",
       [=](TestScene& t) {
         CoatedConductorMaterial coated;
         coated.roughness = rough(0.2f);
         coated.conductor = metal(0.2f);
         coated.thickness = 0;
         return t.AddMaterial(coated);
       }},
      {"mix",
       [=](TestScene& t) {
         MixMaterial mix;
         mix.material[0] = t.Diffuse(Rgb::Gray(1));
         mix.material[1] = t.AddMaterial(metal(0.3f));
         mix.amount.value = 0.5f;
         return t.AddMaterial(mix);
       }},
  };
}

}  // namespace sheaf::render::testing
