// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hair materials, ready for evaluation at hits.
#pragma once

#include "absl/status/statusor.h"
#include "common/scene/material_description.h"
#include "worker/render/material/texture_program.h"

namespace sheaf::render {

// The parameters of a hair material.
struct CompiledHair {
  HairMaterial::Pigment pigment{};
  ColorOperand color;  // Absorption or reflectance; unused for melanins.
  FloatOperand eumelanin, pheomelanin, eta, beta_m, beta_n, alpha_degrees;
  // Absorption of each melanin at concentration 1.
  ColorOperand eumelanin_absorption, pheomelanin_absorption;
};

// The color of a reflectance is left to the caller, who knows how to check it. Errors: a constant
// that is not in its range, or not finite; without the material's name.
absl::StatusOr<CompiledHair> CompileHair(const HairMaterial& description,
                                         const TextureProgram& textures);

}  // namespace sheaf::render
