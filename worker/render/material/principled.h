// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Principled materials, ready for evaluation at hits: the inputs, and the tables of the parts that
// the material has (principled_table.h). Tables are shared by materials that need the same.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>

#include "absl/status/statusor.h"
#include "common/scene/material_description.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/principled_table.h"
#include "worker/render/material/texture_program.h"

namespace sheaf::render {

struct CompiledPrincipled {
  ColorOperand base_color, specular_tint, sheen_color;
  FloatOperand metallic, roughness, specular, transmission, coat, iridescence;
  float anisotropy = 0;
  PrincipledSurface surface;
};

struct PrincipledOptions {
  bool spectral = false;
  bool keeps_energy = true;
};

struct PrincipledTables {
  // Both alphas (negative for all nodes), index, index and thickness of the film (0 for none), and
  // whether light is refracted.
  std::map<std::array<float, 6>, PrincipledTable> tables;
  std::deque<CompiledPrincipled> materials;

  uint64_t memory_bytes() const;
};

// Adds the material to *tables, which must outlive what is made of it. Errors: a constant that is
// not in its range (PrincipledMaterial::ForEachNumber), or not finite; without the material's name.
// Cost: up to 30 ms for the tables of constant roughness, 20 times that for textures, and 3 times
// that for a film in spectral transport.
absl::StatusOr<const CompiledPrincipled*> CompilePrincipled(const PrincipledMaterial& description,
                                                            const TextureProgram& textures,
                                                            const PrincipledOptions& options,
                                                            PrincipledTables* tables);

// The Bsdf at a point. Thread safety: any number of threads at once. Instantiated for both colors.
template <typename Color>
BsdfOf<Color> MakePrincipled(const TextureProgram& textures, const CompiledPrincipled& material,
                             const TexturePoint& point, const WavelengthsOf<Color>& wavelengths);

}  // namespace sheaf::render
