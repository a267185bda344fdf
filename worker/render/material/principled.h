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
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/material_description.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/principled_table.h"
#include "worker/render/material/texture_program.h"

namespace sheaf::render {

// Inputs on which the tables and axes of a surface depend. Where they are textures, hits use the
// nearest of a limited number of levels, whose surfaces are made with the material.
struct PrincipledLevels {
  enum Input { kCoatRoughness, kSheenRoughness, kFilmThickness, kTurn, kInputCount };
  static constexpr int kLevelsMax = 256;     // One input: as many as a texel of 8 bits has.
  static constexpr int kSurfacesMax = 4096;  // One material.
  static constexpr int kCoatTablesMax = 17;  // Curves between them are interpolated.
  static constexpr int kSheenLevelsMax = 32;
  // Tables of films of constant and of textured roughness; a film has the nearest one.
  static constexpr int kFilmTablesMax = 16, kFilmTablesOfTexturesMax = 4;

  std::array<int, kInputCount> count = {1, 1, 1, 1};  // 1: constant.
  float film_least_nm = 0, film_most_nm = 0;

  // The levels of inputs of which these vary: as many as the limits allow.
  static PrincipledLevels For(const std::array<bool, kInputCount>& varies);
  // The level nearest to a place in [0, 1]; of a turn, 1 is 0 again. Outside: at the nearer end.
  int LevelAt(Input input, float place) const;
};

struct CompiledPrincipled {
  ColorOperand base_color, specular_tint, sheen_color;
  FloatOperand metallic, roughness, specular, transmission, coat, iridescence, anisotropy;
  FloatOperand rotation_radians, coat_roughness, sheen_roughness, film_nm;
  int32_t direction = kNone;  // Texture of the direction of the anisotropy.
  PrincipledLevels levels;
  std::vector<PrincipledSurface> surfaces;  // By level: the first input's vary fastest.
};

struct PrincipledOptions {
  bool spectral = false;
  bool keeps_energy = true;
  bool coat_has_normals = false;  // Then it is never perfectly smooth.
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
// that for a film in spectral transport; kFilmTablesMax times that for a film of textured
// thickness.
absl::StatusOr<const CompiledPrincipled*> CompilePrincipled(const PrincipledMaterial& description,
                                                            const TextureProgram& textures,
                                                            const PrincipledOptions& options,
                                                            PrincipledTables* tables);

// The Bsdf at a point. Thread safety: any number of threads at once. Instantiated for both colors.
template <typename Color>
BsdfOf<Color> MakePrincipled(const TextureProgram& textures, const CompiledPrincipled& material,
                             const TexturePoint& point, const WavelengthsOf<Color>& wavelengths);

}  // namespace sheaf::render
