// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTable::Impl: the data of a LightTable, shared by the files that read, build and sample it.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "worker/render/color/spectral_color.h"
#include "worker/render/light/environment_map.h"
#include "worker/render/light/intensity_map.h"
#include "worker/render/light/light_choice.h"
#include "worker/render/light/light_table.h"
#include "worker/render/light/photometric_web.h"
#include "worker/render/light/projected_image.h"
#include "worker/render/light/sky_portal.h"

namespace sheaf::render {

// |L| for light selection: counts either sign, and is positive wherever a channel is not 0.
inline float StrengthOf(Rgb c) {
  if (!IsFinite(c)) return 0;
  return Luminance({std::fabs(c.r), std::fabs(c.g), std::fabs(c.b)});
}

// Factor of a goniometric light's intensity by direction.
using IntensityDistribution = std::variant<IntensityMap, PhotometricWeb>;

// A light without size or at infinity in one direction. Space: render.
struct DeltaLight {
  enum class Kind : uint8_t { kPoint, kSpot, kDistant, kGoniometric, kProjection };
  Kind kind = Kind::kPoint;
  Vec3d position;              // All but kDistant.
  Vec3f to_light;              // kDistant: unit, towards the light.
  Emission emission;           // Intensity; radiance (irradiance on a facing plane) if kDistant;
                               // gray factor of the image if kProjection.
  Vec3f light_from_render[3];  // kSpot: rows of the linear map to the space of axis. kGoniometric,
                               // kProjection: to the space of the image.
  Vec3f axis;                  // kSpot, kProjection: unit, in the light's space.
  // kSpot: falls off smoothly between these cosines with axis. kProjection: zero beyond cos_end.
  float cos_start = 1, cos_end = 1;
  int32_t description = kNone;  // Index in SceneDescription::lights.
  size_t image = 0;             // Index in Impl::intensities, or Impl::projected_images.
};

// A light from all directions; constant where it has no map.
struct InfiniteEmitter {
  std::optional<EnvironmentMap> map;
  Emission radiance;            // Constant.
  float scale = 1;              // Scale of the map; 1 where there is none.
  int32_t description = kNone;  // Index in SceneDescription::lights.
  Vec3f light_from_render[3];   // Rows of a rotation (or reflection).
  // If present, only light that arrives through it counts. Requires a map.
  std::optional<SkyPortal> portal;
};

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
  std::vector<IntensityDistribution> intensities;
  std::vector<ProjectedImage> projected_images;
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
  uint32_t first_sphere() const { return static_cast<uint32_t>(triangles.size()); }
  uint32_t first_disk() const { return first_sphere() + static_cast<uint32_t>(spheres.size()); }
  uint32_t first_delta() const { return first_disk() + static_cast<uint32_t>(disks.size()); }
  uint32_t first_infinite() const { return first_delta() + static_cast<uint32_t>(deltas.size()); }
};

// Fraction of its emission that a light without size sends along the unit direction w, which leaves
// the light. Not for projections, whose fraction has a color.
float FalloffAlong(const LightTable::Impl& impl, const DeltaLight& light, Vec3f w);

}  // namespace sheaf::render
