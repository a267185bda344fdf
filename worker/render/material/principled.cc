// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/principled.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>

#include "absl/strings/str_cat.h"
#include "common/base/vector_bytes.h"
#include "worker/render/bsdf/principled_lobe.h"
#include "worker/render/material/material.h"

namespace sheaf::render {
namespace {

// Where one direction is rough, the other cannot be perfectly smooth (material.cc).
constexpr float kLeastAlpha = 1e-4f;

// Keeps NaN, so that an unreadable texel is noticed.
float ToFraction(float value) { return value < 0 ? 0 : (value > 1 ? 1 : value); }
template <typename Color>
Color ToFractions(const Color& color) {
  return MakeColor<Color>([&](size_t c) { return ToFraction(color[c]); });
}

// Along the rougher direction and across it. Source: KHR_materials_anisotropy.
Ggx AlphaOf(float roughness, float anisotropy) {
  const float alpha = roughness * roughness;
  const Ggx ggx{alpha + (1 - alpha) * anisotropy * anisotropy, alpha};
  if (ggx.IsSmooth()) return ggx;
  return {std::max(kLeastAlpha, ggx.alpha_x), std::max(kLeastAlpha, ggx.alpha_y)};
}

bool IsPresent(const FloatOperand& operand) {
  return operand.texture != kNone || operand.value > 0;
}

absl::Status CheckConstants(const PrincipledMaterial& d) {
  std::string what;
  PrincipledMaterial::ForEachNumber(
      d, [&](const char* name, const auto& input, float low, float high) {
        float value = 0;
        if constexpr (std::is_same_v<std::decay_t<decltype(input)>, FloatInput>) {
          if (input.texture != kNone) return;
          value = input.value;
        } else {
          value = input;
        }
        if (value >= low && value <= high) return;
        what = absl::StrCat(name, " ", value, " must lie in [", low, ", ", high, "]");
      });
  const struct {
    const char* name;
    const ColorInput& input;
  } colors[] = {{"base_color", d.base_color},
                {"specular_tint", d.specular_tint},
                {"sheen_color", d.sheen_color}};
  for (const auto& color : colors) {
    if (color.input.texture != kNone || IsFinite(color.input.value.rgb)) continue;
    what = absl::StrCat(color.name, " must be finite");
  }
  return what.empty() ? absl::OkStatus() : absl::InvalidArgumentError(what);
}

void SetLayers(const PrincipledMaterial& d, CompiledPrincipled* m) {
  PrincipledSurface& surface = m->surface;
  surface.coat_eta = d.coat_ior;
  surface.coat = AlphaOf(d.coat_roughness, 0);
  if (IsPresent(m->coat) && !surface.coat.IsSmooth()) {
    surface.coat_albedo = CoatAlbedo(surface.coat, d.coat_ior);
  }
  surface.has_sheen = m->sheen_color.texture != kNone || !d.sheen_color.value.rgb.IsBlack();
  if (surface.has_sheen) surface.sheen = Sheen::Make(d.sheen_roughness);
}

}  // namespace

uint64_t PrincipledTables::memory_bytes() const {
  uint64_t bytes = materials.size() * sizeof(CompiledPrincipled);
  for (const auto& [key, table] : tables) {
    bytes += VectorBytes(table.rows);
    for (const PrincipledRow& row : table.rows) {
      for (const FacetShares* side : {&row.out, &row.in}) {
        bytes += VectorBytes(side->film) + VectorBytes(side->film_cross);
      }
    }
  }
  return bytes;
}

absl::StatusOr<const CompiledPrincipled*> CompilePrincipled(const PrincipledMaterial& d,
                                                            const TextureProgram& textures,
                                                            const PrincipledOptions& options,
                                                            PrincipledTables* tables) {
  if (absl::Status status = CheckConstants(d); !status.ok()) return status;
  CompiledPrincipled& m = tables->materials.emplace_back();
  m.base_color = textures.Operand(d.base_color, ColorRole::kReflectance);
  m.specular_tint = textures.Operand(d.specular_tint, ColorRole::kReflectance);
  m.sheen_color = textures.Operand(d.sheen_color, ColorRole::kReflectance);
  m.metallic = textures.Operand(d.metallic);
  m.roughness = textures.Operand(d.roughness);
  m.specular = textures.Operand(d.specular);
  m.transmission = textures.Operand(d.transmission);
  m.coat = textures.Operand(d.coat);
  m.iridescence = textures.Operand(d.iridescence);
  m.anisotropy = d.anisotropy;
  PrincipledSurface& surface = m.surface;
  surface.rise = FresnelRise::Make(d.ior);
  surface.thin = d.thin;
  surface.turned = d.anisotropy > 0 && d.rotation_radians != 0;
  surface.turn = SinCos(d.rotation_radians);
  surface.film = {d.iridescence_ior, d.iridescence_thickness_nm};
  surface.has_film = IsPresent(m.iridescence) && d.iridescence_thickness_nm > 0;
  SetLayers(d, &m);
  PrincipledTableOptions table_options;
  table_options.eta = d.ior;
  table_options.refracts =
      IsPresent(m.transmission) && !d.thin && d.ior - 1 >= kPrincipledIndexDifferenceMin;
  table_options.keeps_energy = options.keeps_energy;
  table_options.film = surface.has_film ? &surface.film : nullptr;
  table_options.spectral = options.spectral;
  const bool varies = m.roughness.texture != kNone;
  const Ggx ggx = varies ? Ggx{-1, -1} : AlphaOf(m.roughness.value, d.anisotropy);
  const ThinFilm film = surface.has_film ? surface.film : ThinFilm{0, 0};
  const auto [found, is_new] =
      tables->tables.try_emplace({ggx.alpha_x, ggx.alpha_y, d.ior, film.eta, film.thickness_nm,
                                  table_options.refracts ? 1.0f : 0.0f});
  if (is_new) {
    found->second = varies ? PrincipledTable::MakeForAllAlphas(table_options)
                           : PrincipledTable::Make(table_options, ggx);
  }
  surface.table = &found->second;
  return &m;
}

template <typename Color>
BsdfOf<Color> MakePrincipled(const TextureProgram& textures, const CompiledPrincipled& m,
                             const TexturePoint& point, const WavelengthsOf<Color>& wavelengths) {
  const auto color = [&](const ColorOperand& operand) {
    return ToFractions(textures.Value<Color>(operand, point, wavelengths));
  };
  const auto number = [&](const FloatOperand& operand) {
    return ToFraction(textures.Float(operand, point));
  };
  BsdfOf<Color> bsdf;
  bsdf.kind = BsdfKind::kPrincipled;
  bsdf.principled = &m.surface;
  bsdf.eta = m.surface.rise.eta;
  bsdf.color = color(m.base_color);
  bsdf.conductor_eta = color(m.specular_tint);
  bsdf.conductor_k = color(m.sheen_color);
  const Ggx ggx = AlphaOf(number(m.roughness), m.anisotropy);
  bsdf.alpha_x = ggx.alpha_x;
  bsdf.alpha_y = ggx.alpha_y;
  bsdf.base = {number(m.metallic), number(m.transmission)};
  bsdf.top = {number(m.coat), number(m.specular)};
  bsdf.blend = number(m.iridescence);
  bsdf.specular = IsPrincipledSpecular(bsdf);
  if constexpr (std::is_same_v<Color, Rgb>) {
    bsdf.albedo = bsdf.color;
  } else {
    bsdf.albedo = {wavelengths.nm};
  }
  return bsdf;
}
template Bsdf MakePrincipled(const TextureProgram&, const CompiledPrincipled&, const TexturePoint&,
                             const NoWavelengths&);
template BsdfOf<Spectral> MakePrincipled(const TextureProgram&, const CompiledPrincipled&,
                                         const TexturePoint&, const Wavelengths&);

}  // namespace sheaf::render
