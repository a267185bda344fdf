// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightEmission: samples the rays with which light leaves its sources, and gives their densities:
// where light paths begin. A light is chosen by its power; a point on it uniformly; a direction by
// the cosine (surfaces), the intensity (lights without size) or the radiance (lights at infinity).
// Source: Veach 1997, sec. 8.2 and 10.2; Pharr, Jakob and Humphreys, "Physically Based Rendering",
// 3rd ed., sec. 14.5 and 16.1.2.
//
// The emission of media counts as one more light, which is chosen here and sampled elsewhere
// (EmissionPoints).
//
// The density of a ray is per the measure in which its light emits:
//   surfaces                area of the light * solid angle      power: radiance * cosine
//   lights with a position  solid angle                          power: intensity
//   distant lights          area perpendicular to the ray        power: irradiance
//   lights at infinity      that area * solid angle              power: radiance
// so the flux of a light is the mean of power / pdf over its rays. See docs/adr/0063.
#pragma once

#include <cstdint>
#include <optional>

#include "worker/render/light/delta_lights.h"
#include "worker/render/light/emission_place.h"
#include "worker/render/light/light_table.h"
#include "worker/render/sampling/discrete_distribution.h"

namespace sheaf::render {

struct InfiniteEmitter;

// Color: Rgb, or Spectral at the wavelengths of the path.
template <typename Color>
struct EmittedRayOf {
  Vec3f p;         // On the light; for distant and infinite lights before everything they reach.
  Vec3f p_error;   // Bound of the absolute rounding error of p.
  Vec3f n;         // Normal of a surface there, as LightSample::n_light; zero otherwise.
  Vec3f w;         // Unit, leaving the light.
  Color power;     // Per the light's measure, above.
  double pdf = 0;  // The ray's pdf in that measure, times the probability of choosing the light.
  uint32_t light = 0;
  bool is_infinite = false;  // p is not on the light.
  bool is_unseen = false;    // No ray hits the light there, as EmissionDetail says.
  // As in LightSample: the shape whose alpha cut-out the caller must still apply.
  int32_t cut_out = kNone;
  Vec2f uv;
};
using EmittedRay = EmittedRayOf<Rgb>;

// Independent numbers in [0, 1), multiples of 2^-24.
struct EmissionUniforms {
  float light = 0;
  Vec2f position, direction;
};

class LightEmission {
 public:
  // lights: must outlive *this. Distant and infinite lights send rays through the sphere about
  // `center` (render space) only; they have no power where the radius is 0. media_power: that of
  // the emission of media, as power().
  LightEmission(const LightTable& lights, Vec3d center, double radius, double media_power = 0);

  // Whether no light has power.
  bool empty() const { return choice_.empty(); }
  // Estimate of the power of all lights: luminance times the light's measure, watts where the
  // scene's numbers are. Exact for constant emission and undistorted lights.
  double power() const { return power_; }
  uint64_t memory_bytes() const;

  // The probability with which paths begin in media.
  double media_probability() const { return media_probability_; }
  // Where the sample chooses media, a number in [0, 1) for a choice among them, independent of the
  // other numbers of u.
  std::optional<double> ChooseMedia(const EmissionUniforms& u) const {
    return ChooseMedia(ChoiceOf(u));
  }
  // The same by a choice in [0, 1).
  std::optional<double> ChooseMedia(double choice) const {
    if (media_probability_ == 0) return std::nullopt;
    return MediaChoice(choice);
  }

  // Samples a ray of a light that is no medium. None where the sample carries no light. Never
  // returns a pdf that is 0 or not finite. A ray of an infinite light with a portal illuminates
  // only points that it meets beyond the portal: those at which PdfLe is positive.
  template <typename Color = Rgb>
  std::optional<EmittedRayOf<Color>> SampleLe(const EmissionUniforms& u,
                                              const WavelengthsOf<Color>& wavelengths = {}) const {
    if (empty()) return std::nullopt;
    return SampleLeOf<Color>(ChoiceOf(u), u, wavelengths);
  }
  // The same of the light that the choice, in [0, 1), gives. Requires: !empty().
  template <typename Color>
  std::optional<EmittedRayOf<Color>> SampleLeOf(double choice, const EmissionUniforms& u,
                                                const WavelengthsOf<Color>& wavelengths) const;
  // The pdf of SampleLe for the ray that leaves the light along w (unit). p: the point that it
  // reaches; used for lights at infinity only. n: as EmittedRay::n. The bits are those of
  // EmittedRay::pdf, but where rounding puts a direction into the next texel.
  double PdfLe(uint32_t light, Vec3f p, Vec3f n, Vec3f w) const;

  // The density of rays that reach p along w, in the measure in which a path from p finds the
  // light: PdfLe over the cosine (surfaces), over the squared distance (lights with a position), or
  // itself (at infinity). p_light: the point of the light. Finite.
  double DensityAt(uint32_t light, Vec3f p, Vec3f p_light, Vec3f n, Vec3f w) const;
  // The sum over all infinite lights, which are found together; without distant ones.
  double InfiniteDensityAt(Vec3f p, Vec3f w) const;
  bool IsInfinite(uint32_t light) const;
  // A light on a surface.
  bool IsSurface(uint32_t light) const;
  // The table's lights; those at infinity are the last ones.
  uint32_t light_count() const;
  uint32_t first_infinite() const;

  // --- The choice of a light: lights have intervals of [0, 1), in the order of their numbers.

  // Lights that can be chosen: those of the table, and the media as the last one if they have
  // power.
  uint32_t choice_count() const;
  // The number in [0, 1) by which the sample chooses.
  static double ChoiceOf(const EmissionUniforms& u) {
    return ExtendBits(u.light, SaltOf(u.position));
  }
  // Begin of the interval of the light, or of the one after the last. Requires: !empty().
  double ChoiceBegin(uint32_t light) const { return choice_.Begin(light); }
  // Requires: !empty(), choice in [0, 1).
  uint32_t Choose(double choice) const { return static_cast<uint32_t>(choice_.Sample(choice)); }

  // --- Places: coordinates of the rays of a light, by which they are learned (emission_places.cc).

  // Coordinates in which the rays of the light differ. Media have directions alone.
  EmissionAxes AxesOf(uint32_t light) const;
  // The ray of a light that is no medium at the place; its pdf is PlaceDensity, and so never 0.
  // None where it carries no light.
  template <typename Color = Rgb>
  std::optional<EmittedRayOf<Color>> RayAt(uint32_t light, const EmissionPlace& place,
                                           const WavelengthsOf<Color>& wavelengths = {}) const;
  // The place of the ray that leaves the light along w. p: a point on the ray; used for lights at
  // infinity only. p_light, n: as for DensityAt. Media: by w alone.
  EmissionPlace PlaceOfRay(uint32_t light, Vec3f p, Vec3f p_light, Vec3f n, Vec3f w) const;
  // The density of the light's rays if their places are uniform, without the probability of
  // choosing the light: in the measure of PdfLe, but over the cosine for surfaces.
  double PlaceDensity(uint32_t light) const;
  // The density of SampleLe's rays of the light along w, over that of rays with uniform places. 1
  // for media.
  double OwnDensity(uint32_t light, Vec3f w) const;

 private:
  std::optional<double> MediaChoice(double choice) const;
  // PdfLe over the cosine.
  double SurfaceDensity(uint32_t light, double cosine) const;
  double PowerOf(uint32_t light) const;
  // Area perpendicular to the rays of lights at infinity.
  double CrossSection() const;
  // The point and the direction of RayAt for a surface.
  template <typename Color>
  void PlaceOnSurface(uint32_t light, const EmissionPlace& place,
                      const WavelengthsOf<Color>& wavelengths, EmittedRayOf<Color>* ray) const;
  // The ray of a light at infinity through a point of the disk, along the ray's w.
  template <typename Color>
  void PlaceOnDisk(Vec2d position, EmittedRayOf<Color>* ray) const;
  // These set all of the ray but the light; SampleInfinite alone sets pdf, too.
  template <typename Color>
  void SampleSurface(uint32_t light, const EmissionUniforms& u,
                     const WavelengthsOf<Color>& wavelengths, EmittedRayOf<Color>* ray) const;
  template <typename Color>
  void SampleDelta(uint32_t light, const EmissionUniforms& u,
                   const WavelengthsOf<Color>& wavelengths, EmittedRayOf<Color>* ray) const;
  template <typename Color>
  void SampleInfinite(const InfiniteEmitter& light, double probability, const EmissionUniforms& u,
                      const WavelengthsOf<Color>& wavelengths, EmittedRayOf<Color>* ray) const;
  // The point before the sphere on the line through q along w.
  Vec3f StartBefore(Vec3d q, Vec3f w) const;
  // A line along w through the sphere's disk perpendicular to it.
  Vec3d PointOnDisk(Vec3f w, Vec2f u) const;

  const LightTable* lights_;
  Vec3d center_;
  double radius_;
  ImageSamplers samplers_;
  DiscreteDistribution choice_;  // By light; the last is the media, if they have power.
  double power_ = 0, media_probability_ = 0;
};

}  // namespace sheaf::render
