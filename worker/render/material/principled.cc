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

bool Varies(const FloatOperand& operand) { return operand.texture != kNone; }

// A coat with normals of its own has no mirror direction that light of both ends would share.
constexpr float kTiltedCoatRoughnessMin = 0.03f;

// Makes the surfaces of a material, one for each combination of levels.
class SurfaceMaker {
 public:
  SurfaceMaker(const PrincipledMaterial& d, const PrincipledOptions& options,
               PrincipledTables* tables, CompiledPrincipled* m)
      : d_(d), options_(options), tables_(*tables), m_(*m) {}

  void Make() {
    const bool has_anisotropy = IsPresent(m_.anisotropy);
    has_film_ = IsPresent(m_.iridescence) && IsPresent(m_.film_nm);
    has_sheen_ = m_.sheen_color.texture != kNone || !d_.sheen_color.value.rgb.IsBlack();
    const bool turn_varies = Varies(m_.rotation_radians) || m_.direction != kNone;
    has_turn_ = has_anisotropy && (turn_varies || m_.rotation_radians.value != 0);
    m_.levels = PrincipledLevels::For({IsPresent(m_.coat) && Varies(m_.coat_roughness),
                                       has_sheen_ && Varies(m_.sheen_roughness),
                                       has_film_ && Varies(m_.film_nm), has_turn_ && turn_varies});
    m_.levels.film_least_nm = d_.film_least_nm;
    m_.levels.film_most_nm = d_.film_most_nm;
    const auto& count = m_.levels.count;
    const std::vector<PrincipledSurface> coats = Coats(), sheens = Sheens(), films = Films();
    for (int turn = 0; turn < count[PrincipledLevels::kTurn]; ++turn) {
      for (const PrincipledSurface& film : films) {
        for (const PrincipledSurface& sheen : sheens) {
          for (const PrincipledSurface& coat : coats) {
            PrincipledSurface& surface = m_.surfaces.emplace_back(coat);
            surface.rise = FresnelRise::Make(d_.ior);
            surface.thin = d_.thin;
            surface.has_sheen = has_sheen_;
            surface.sheen = sheen.sheen;
            surface.has_film = film.has_film;
            surface.film = film.film;
            surface.table = film.table;
            SetTurn(turn, &surface);
          }
        }
      }
    }
  }

 private:
  void SetTurn(int level, PrincipledSurface* surface) const {
    const int count = m_.levels.count[PrincipledLevels::kTurn];
    surface->turned = has_turn_;
    const auto half_turn = static_cast<float>(kPi);
    surface->turn =
        SinCos(count == 1 ? m_.rotation_radians.value
                          : half_turn * static_cast<float>(level) / static_cast<float>(count));
  }

  float RoughnessAt(const FloatOperand& operand, PrincipledLevels::Input which, int level) const {
    const int count = m_.levels.count[which];
    return count == 1 ? ToFraction(operand.value)
                      : static_cast<float>(level) / static_cast<float>(count - 1);
  }

  std::vector<PrincipledSurface> Coats() const {
    const int count = m_.levels.count[PrincipledLevels::kCoatRoughness];
    const auto ggx_at = [&](float roughness) {
      if (options_.coat_has_normals) roughness = std::max(roughness, kTiltedCoatRoughnessMin);
      return AlphaOf(roughness, 0);
    };
    std::vector<MuCurve> curves;  // At equal steps of roughness.
    for (int i = 0; i < PrincipledLevels::kCoatTablesMax && count > 1; ++i) {
      const float roughness = static_cast<float>(i) / (PrincipledLevels::kCoatTablesMax - 1);
      curves.push_back(CoatAlbedo(ggx_at(roughness), d_.coat_ior));
    }
    std::vector<PrincipledSurface> surfaces(static_cast<size_t>(count));
    for (int level = 0; level < count; ++level) {
      PrincipledSurface& surface = surfaces[static_cast<size_t>(level)];
      const float roughness =
          RoughnessAt(m_.coat_roughness, PrincipledLevels::kCoatRoughness, level);
      surface.coat_eta = d_.coat_ior;
      surface.coat = ggx_at(roughness);
      if (!IsPresent(m_.coat) || surface.coat.IsSmooth()) continue;
      if (count == 1) {
        surface.coat_albedo = CoatAlbedo(surface.coat, d_.coat_ior);
        continue;
      }
      const float at = roughness * (PrincipledLevels::kCoatTablesMax - 1);
      const size_t first = std::min(static_cast<size_t>(at), curves.size() - 2);
      const float rest = at - static_cast<float>(first);
      for (size_t i = 0; i < surface.coat_albedo.value.size(); ++i) {
        const float low = curves[first].value[i], high = curves[first + 1].value[i];
        surface.coat_albedo.value[i] = low + rest * (high - low);
      }
    }
    return surfaces;
  }

  std::vector<PrincipledSurface> Sheens() const {
    const int count = m_.levels.count[PrincipledLevels::kSheenRoughness];
    std::vector<PrincipledSurface> surfaces(static_cast<size_t>(count));
    for (int level = 0; level < count && has_sheen_; ++level) {
      surfaces[static_cast<size_t>(level)].sheen =
          Sheen::Make(RoughnessAt(m_.sheen_roughness, PrincipledLevels::kSheenRoughness, level));
    }
    return surfaces;
  }

  std::vector<PrincipledSurface> Films() const {
    const int count = m_.levels.count[PrincipledLevels::kFilmThickness];
    const bool varies = Varies(m_.roughness) || Varies(m_.anisotropy);
    const int tables =
        varies ? PrincipledLevels::kFilmTablesOfTexturesMax : PrincipledLevels::kFilmTablesMax;
    const float least = m_.levels.film_least_nm, range = m_.levels.film_most_nm - least;
    const auto at = [&](float place) {
      return count == 1 ? m_.film_nm.value : least + range * place;
    };
    std::vector<PrincipledSurface> surfaces(static_cast<size_t>(count));
    for (int level = 0; level < count; ++level) {
      PrincipledSurface& surface = surfaces[static_cast<size_t>(level)];
      const float place = static_cast<float>(level) / static_cast<float>(std::max(count - 1, 1));
      surface.film = {d_.iridescence_ior, at(place)};
      surface.has_film = has_film_ && surface.film.thickness_nm > 0;
      const float middle =
          (static_cast<float>(level * tables / count) + 0.5f) / static_cast<float>(tables);
      surface.table = TableOf({d_.iridescence_ior, at(middle)}, surface.has_film, varies);
    }
    return surfaces;
  }

  const PrincipledTable* TableOf(const ThinFilm& film, bool has_film, bool varies) const {
    PrincipledTableOptions options;
    options.eta = d_.ior;
    options.refracts =
        IsPresent(m_.transmission) && !d_.thin && d_.ior - 1 >= kPrincipledIndexDifferenceMin;
    options.keeps_energy = options_.keeps_energy;
    options.film = has_film ? &film : nullptr;
    options.spectral = options_.spectral;
    const Ggx ggx = varies ? Ggx{-1, -1} : AlphaOf(m_.roughness.value, m_.anisotropy.value);
    const auto [found, is_new] = tables_.tables.try_emplace(
        {ggx.alpha_x, ggx.alpha_y, d_.ior, has_film ? film.eta : 0,
         has_film ? film.thickness_nm : 0, options.refracts ? 1.0f : 0.0f});
    if (is_new) {
      found->second =
          varies ? PrincipledTable::MakeForAllAlphas(options) : PrincipledTable::Make(options, ggx);
    }
    return &found->second;
  }

  const PrincipledMaterial& d_;
  const PrincipledOptions& options_;
  PrincipledTables& tables_;
  CompiledPrincipled& m_;
  bool has_film_ = false, has_sheen_ = false, has_turn_ = false;
};

}  // namespace

uint64_t PrincipledTables::memory_bytes() const {
  uint64_t bytes = materials.size() * sizeof(CompiledPrincipled);
  for (const CompiledPrincipled& m : materials) bytes += VectorBytes(m.surfaces);
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
  m.anisotropy = textures.Operand(d.anisotropy);
  m.rotation_radians = textures.Operand(d.rotation_radians);
  m.coat_roughness = textures.Operand(d.coat_roughness);
  m.sheen_roughness = textures.Operand(d.sheen_roughness);
  m.film_nm = textures.Operand(d.iridescence_thickness_nm);
  m.direction = d.anisotropy_direction;
  if (m.direction != kNone && textures.ImageChannels(m.direction) < 2) {
    return absl::InvalidArgumentError(
        "its texture of anisotropy has no red and green; give an image in color");
  }
  SurfaceMaker(d, options, tables, &m).Make();
  return &m;
}

PrincipledLevels PrincipledLevels::For(const std::array<bool, kInputCount>& varies) {
  PrincipledLevels levels;
  int surfaces = 1;
  for (size_t i = 0; i < kInputCount; ++i) {
    if (!varies[i]) continue;
    levels.count[i] = i == kSheenRoughness ? kSheenLevelsMax : kLevelsMax;
    surfaces *= levels.count[i];
  }
  while (surfaces > kSurfacesMax) {
    int& most = *std::max_element(levels.count.begin(), levels.count.end());
    most /= 2;
    surfaces /= 2;
  }
  return levels;
}

int PrincipledLevels::LevelAt(Input input, float place) const {
  const int steps = count[input] - (input == kTurn ? 0 : 1);
  if (!(place > 0)) return 0;  // Also for NaN.
  const int level = static_cast<int>(std::min(place, 1.0f) * static_cast<float>(steps) + 0.5f);
  return input == kTurn ? level % count[input] : level;
}

namespace {

// The place of a turn of the anisotropy between 0 and half a turn, where the axes are as at 0.
float PlaceOfTurn(const TextureProgram& textures, const CompiledPrincipled& m,
                  const TexturePoint& point) {
  float turn = textures.Float(m.rotation_radians, point);
  if (m.direction != kNone) {
    const Rgb texel = textures.Value<Rgb>({m.direction, {}, {}}, point, {});
    turn += Atan2(2 * texel.g - 1, 2 * texel.r - 1);
  }
  const float half_turns = turn * static_cast<float>(1 / kPi);
  return half_turns - std::floor(half_turns);
}

// The surface of the levels that are nearest to the inputs. *broken: a texel that is no number.
const PrincipledSurface& SurfaceAt(const TextureProgram& textures, const CompiledPrincipled& m,
                                   const TexturePoint& point, float* broken) {
  using Levels = PrincipledLevels;
  const Levels& levels = m.levels;
  const auto place = [&](Levels::Input input) {
    switch (input) {
      case Levels::kCoatRoughness:
        return textures.Float(m.coat_roughness, point);
      case Levels::kSheenRoughness:
        return textures.Float(m.sheen_roughness, point);
      case Levels::kFilmThickness:
        return (textures.Float(m.film_nm, point) - levels.film_least_nm) /
               (levels.film_most_nm - levels.film_least_nm);
      default:
        return PlaceOfTurn(textures, m, point);
    }
  };
  int index = 0, stride = 1;
  for (int i = 0; i < Levels::kInputCount; ++i) {
    const int count = levels.count[static_cast<size_t>(i)];
    if (count == 1) continue;
    const auto input = static_cast<Levels::Input>(i);
    const float at = place(input);
    if (std::isnan(at)) *broken = at;
    index += stride * levels.LevelAt(input, at);
    stride *= count;
  }
  return m.surfaces[static_cast<size_t>(index)];
}

}  // namespace

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
  float broken = 0;
  bsdf.principled =
      m.surfaces.size() == 1 ? m.surfaces.data() : &SurfaceAt(textures, m, point, &broken);
  bsdf.eta = bsdf.principled->rise.eta;
  bsdf.color = color(m.base_color);
  bsdf.conductor_eta = color(m.specular_tint);
  bsdf.conductor_k = color(m.sheen_color);
  const Ggx ggx = AlphaOf(number(m.roughness), number(m.anisotropy));
  bsdf.alpha_x = ggx.alpha_x;
  bsdf.alpha_y = ggx.alpha_y;
  bsdf.base = {number(m.metallic), number(m.transmission)};
  bsdf.top = {number(m.coat) + broken, number(m.specular)};
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
