// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTable::Impl: the lights of a LightTable, for the files that read, build and sample it.
// Lights are structs in lists, one for each kind: with a surface (area_lights.h), without size
// (delta_lights.h), and at infinity (infinite_light.h). Each has
//   Bounds(maps): for the choice among lights.
//   Power(maps, cross_section): luminance times the light's measure, as LightEmission::power.
//     cross_section: area perpendicular to the rays of lights at infinity.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "worker/render/color/spectral_color.h"
#include "worker/render/light/area_lights.h"
#include "worker/render/light/choice/light_choice.h"
#include "worker/render/light/delta_lights.h"
#include "worker/render/light/infinite_light.h"
#include "worker/render/light/light_table.h"

namespace sheaf::render {

struct LightTable::Impl {
  // By light index: triangles, spheres, disks (the emitter ids), then delta, then infinite lights.
  std::vector<TriangleEmitter> triangles;
  std::vector<SphereEmitter> spheres;
  std::vector<DiskEmitter> disks;
  std::vector<int32_t> detail_of;
  std::vector<EmissionDetail> details;
  EmissionMaps maps;
  std::vector<Quadric> quadrics;
  std::vector<DeltaLight> deltas;
  LightMaps light_maps;
  std::vector<InfiniteEmitter> infinites;
  // By Emission::spectrum; empty unless spectral transport is used.
  std::vector<SpectralColor> spectra;
  LightChoice choice;
  std::vector<uint8_t> group_of_light;  // By light index; empty unless asked for.
  bool empty = true;

  // Null where the emission is constant.
  const EmissionDetail* DetailOf(uint32_t emitter) const {
    if (emitter >= detail_of.size() || detail_of[emitter] == kNone) return nullptr;
    return &details[static_cast<size_t>(detail_of[emitter])];
  }
  // Returns the index of the spectrum.
  int32_t AddSpectrum(const ColorSpec& color) {
    spectra.push_back(SpectralColor::Make(color, ColorRole::kIlluminant));
    return static_cast<int32_t>(spectra.size() - 1);
  }
  // True if every light sample comes from one environment map without a portal.
  bool HasOnlyOneMap() const {
    return !empty && first_infinite() == 0 && infinites.size() == 1 && infinites[0].map &&
           !infinites[0].portal;
  }
  Rgb ColorOfEmission(const Emission& emission, NoWavelengths) const { return emission.rgb; }
  Spectral ColorOfEmission(const Emission& emission, const Wavelengths& wavelengths) const {
    if (emission.spectrum == kNone) {
      return Upsample(emission.rgb, ColorRole::kIlluminant, wavelengths);
    }
    return spectra[static_cast<size_t>(emission.spectrum)].At(wavelengths) *
           emission.spectrum_scale;
  }
  // The emission times a factor, where the factor is all of its color.
  template <typename Color>
  Color ColorTimes(const Emission& emission, Rgb factor,
                   const WavelengthsOf<Color>& wavelengths) const {
    return ColorOfRgb<Color>(factor * emission.rgb, ColorRole::kIlluminant, wavelengths);
  }
  template <typename Color>
  Color ColorTimes(const Emission& emission, float factor,
                   const WavelengthsOf<Color>& wavelengths) const {
    return ColorOfEmission(emission, wavelengths) * factor;
  }
  uint32_t first_sphere() const { return static_cast<uint32_t>(triangles.size()); }
  uint32_t first_disk() const { return first_sphere() + static_cast<uint32_t>(spheres.size()); }
  uint32_t first_delta() const { return first_disk() + static_cast<uint32_t>(disks.size()); }
  uint32_t first_infinite() const { return first_delta() + static_cast<uint32_t>(deltas.size()); }
  uint32_t light_count() const {
    return first_infinite() + static_cast<uint32_t>(infinites.size());
  }

  // f(the light), a struct of any kind with a surface. Requires: light < first_delta().
  template <typename F>
  auto VisitSurface(uint32_t light, const F& f) const {
    if (light < first_sphere()) return f(triangles[light]);
    if (light < first_disk()) return f(spheres[light - first_sphere()]);
    return f(disks[light - first_disk()]);
  }
  // The same of any kind without size. Requires: first_delta() <= light < first_infinite().
  template <typename F>
  auto VisitDelta(uint32_t light, const F& f) const {
    return std::visit(f, deltas[light - first_delta()]);
  }
  // The same of any kind.
  template <typename F>
  auto Visit(uint32_t light, const F& f) const {
    if (light < first_delta()) return VisitSurface(light, f);
    if (light < first_infinite()) return VisitDelta(light, f);
    return f(infinites[light - first_infinite()]);
  }
};

}  // namespace sheaf::render
