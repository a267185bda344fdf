// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTable: every light of the scene, ready to be sampled from a point and to be weighed when a
// scattered ray happens to meet it. Positions are camera-relative (render space), like all
// geometry.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/transform.h"
#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/color/wavelengths.h"
#include "worker/render/geometry/quadric.h"
#include "worker/render/light/emission_map.h"
#include "worker/render/light/environment_map.h"
#include "worker/render/light/light_bounds.h"

namespace sheaf::render {

// Color: Rgb, or Spectral at the wavelengths of the path.
template <typename Color>
struct LightSampleOf {
  Vec3f wi;             // Unit, from the receiving point to the light.
  Vec3f p_light;        // Point on the light; unused where infinite.
  Vec3f p_light_error;  // Bound of the absolute rounding error of p_light.
  Vec3f n_light;        // Geometric normal of area lights, zero otherwise.
  Color radiance;       // Arriving, unoccluded; for delta lights intensity over distance squared.
  float pdf =
      0;  // Solid angle, times the probability of choosing this light; choice alone for delta.
  bool is_delta = false;  // Without size, distant, or never met by rays: no MIS.
  bool is_infinite = false;
  uint32_t light = 0;  // Index in the table; of one of the infinite ones, where infinite.
  // Only where emission varies: the shape (of SceneDescription) whose cut-out is still to be
  // counted, and where it is to be read.
  int32_t cut_out = kNone;
  Vec2f uv;
};
using LightSample = LightSampleOf<Rgb>;

// What the infinite lights together send from a direction.
template <typename Color>
struct EnvironmentValueOf {
  Color radiance;
  float pdf = 0;  // Solid angle, times the probability of choosing these lights.
};
using EnvironmentValue = EnvironmentValueOf<Rgb>;

// What a light emits: as RGB, which also weighs it against others, and as a spectrum of the light
// table times a number. Those of SceneDescription::area_lights come first there, each once however
// many shapes shine by it. Without one, spectral transport raises rgb to a spectrum.
struct Emission {
  Emission() = default;
  // From a colour without a word more, as in an emitter's list of members.
  Emission(Rgb color) : rgb(color) {}
  Emission(const ColorSpec& color, float scale, int32_t spectrum_index)
      : rgb(color.rgb * scale), spectrum(spectrum_index), spectrum_scale(scale) {}

  Rgb rgb;
  int32_t spectrum = kNone;
  float spectrum_scale = 1;
};

// One emitter as the geometry code hands it over. Sides: emits on the side of n (right-hand rule of
// v0 v1 v2 for triangles, outward for spheres, axis for disks), on both where two_sided.
struct TriangleEmitter {
  Vec3f v0, v1, v2;
  Emission radiance;
  bool two_sided = false;
};
struct SphereEmitter {
  Vec3d center;
  double radius = 1;
  Emission radiance;
  bool two_sided = false, inward = false;
};
struct DiskEmitter {
  Vec3d center;
  Vec3d normal, axis_x;
  double radius = 1, inner_radius = 0;
  Emission radiance;
  bool two_sided = false;
};
// Partial spheres and disks, and scaled ones that are no longer spheres, come as triangles.

// What makes the emission of one emitter vary over it.
struct EmissionDetail {
  int32_t map = kNone;  // In LightTableInput::maps: gives the radiance in place of Emission.
  float map_scale = 1;
  int32_t cut_out = kNone;  // Shape of SceneDescription that is cut out where it shines.
  bool is_unseen = false;   // Cut out everywhere: shines, but no ray meets it (pbrt-v4's rule).
  int32_t quadric = kNone;  // In LightTableInput::quadrics; else it is a triangle.
  Vec2f uv[3];              // Of a triangle's corners.
};

struct LightTableInput {
  std::vector<TriangleEmitter> triangles;
  std::vector<SphereEmitter> spheres;
  std::vector<DiskEmitter> disks;
  // By emitter id: index in details, or kNone. Empty where no emission varies.
  std::vector<int32_t> detail_of;
  std::vector<EmissionDetail> details;
  EmissionMaps maps;
  std::vector<Quadric> quadrics;
  bool spectral = false;       // Traits with kSpectral may be asked for.
  bool choose_evenly = false;  // Every light with the same probability, wherever it stands.
  Vec3d render_origin_world;   // World position of render space's origin (the camera).
};

class LightTable {
 public:
  // Emitter ids are: triangles first, then spheres, then disks, in input order. Emitters without
  // area or with values that are not finite keep their ids and are never sampled.
  // Errors: an unreadable picture; a map that is not square; negative or non-finite values (named
  // texel); a light with a transform that cannot be inverted, or one that distorts an environment
  // map.
  static absl::StatusOr<std::unique_ptr<LightTable>> Build(const SceneDescription& scene,
                                                           LightTableInput input,
                                                           FileSource& files);
  ~LightTable();

  uint64_t memory_bytes() const;
  // Whether there is nothing to sample: no light, or all of them black.
  bool empty() const;
  // Chooses a light and a point on it, as seen from p. n: the receiver's geometric normal, or zero
  // in free space; a hint for choosing, and behind it no direction to an infinite light is
  // returned. None where the light cannot reach p. Space: render. Never returns pdf 0, a non-finite
  // value or radiance 0.
  template <uint32_t kTraits>
  std::optional<LightSampleOf<ColorOf<kTraits>>> Sample(
      Vec3f p, Vec3f n, float u_select, Vec2f u,
      const WavelengthsOf<ColorOf<kTraits>>& wavelengths = {}) const {
    return Sample<kTraits>(p, n, u_select, u, wavelengths, PrepareSample<kTraits>(u));
  }
  // The same in two steps: what Sample will need of an environment map begins to be fetched while
  // the caller still works out p. The second step's u must be the first's.
  struct Preparation {
    EnvironmentMap::PlaceSample sky;
  };
  template <uint32_t kTraits>
  Preparation PrepareSample(Vec2f u) const {
    if constexpr (!Has(kTraits, Trait::kEnvironment)) return {};
    return Prepare(*impl_, u);
  }
  template <uint32_t kTraits>
  std::optional<LightSampleOf<ColorOf<kTraits>>> Sample(
      Vec3f p, Vec3f n, float u_select, Vec2f u, const WavelengthsOf<ColorOf<kTraits>>& wavelengths,
      const Preparation& preparation) const {
    return SampleLights<kTraits & kLightTraits>(*impl_, p, n, u_select, u, wavelengths,
                                                preparation);
  }
  // Solid-angle pdf (times choice) with which Sample, called at p with n, would have found the
  // point p_light of the emitter along wi. The same bits as Sample's; 0 where Sample finds nothing.
  template <uint32_t kTraits>
  float PdfEmitter(uint32_t emitter, Vec3f p, Vec3f n, Vec3f wi, Vec3f p_light) const {
    return PdfOfEmitter<kTraits & kLightTraits>(*impl_, emitter, p, n, wi, p_light);
  }
  // Radiance of the emitter towards wo (unit, leaving the light) at its surface point with normal
  // ng: the normal as LightSample::n_light has it (outward for spheres, also inward-emitting ones).
  template <typename Color = Rgb>
  Color EmitterRadiance(uint32_t emitter, Vec3f ng, Vec3f wo,
                        const WavelengthsOf<Color>& wavelengths = {}) const;
  // The same where emission may vary over the surface. uv: where it reads textures.
  template <uint32_t kTraits>
  ColorOf<kTraits> EmitterRadianceAt(uint32_t emitter, Vec3f ng, Vec3f wo, Vec2f uv,
                                     const WavelengthsOf<ColorOf<kTraits>>& wavelengths) const {
    if constexpr (Has(kTraits, Trait::kVaryingEmission)) {
      return VaryingRadiance<ColorOf<kTraits>>(emitter, ng, wo, uv, wavelengths);
    } else {
      return EmitterRadiance<ColorOf<kTraits>>(emitter, ng, wo, wavelengths);
    }
  }
  // Sum over all infinite lights as seen from p along the (unit) direction d, and Sample's pdf of
  // it. Only portals make it differ from one p to the other.
  template <uint32_t kTraits>
  ColorOf<kTraits> EnvironmentRadiance(
      Vec3f p, Vec3f d, const WavelengthsOf<ColorOf<kTraits>>& wavelengths = {}) const {
    if constexpr (!Has(kTraits, Trait::kEnvironment)) return {};
    return RadianceFromInfinity<ColorOf<kTraits>>(*impl_, p, d, wavelengths);
  }
  template <uint32_t kTraits>
  float PdfEnvironment(Vec3f p, Vec3f n, Vec3f d) const {
    if constexpr (!Has(kTraits, Trait::kEnvironment)) return 0;
    return FromInfinity<Rgb>(*impl_, p, n, d, {}, {LocateInFirst(*impl_, d)}).pdf;
  }
  // Both at once, for little more than the price of one.
  template <uint32_t kTraits>
  EnvironmentValueOf<ColorOf<kTraits>> EvalEnvironment(
      Vec3f p, Vec3f n, Vec3f d, const WavelengthsOf<ColorOf<kTraits>>& wavelengths = {}) const {
    return EvalEnvironment<kTraits>(p, n, d, wavelengths, PrepareEnvironment<kTraits>(d));
  }
  // The same in two steps: what is needed of an environment map begins to be fetched while the
  // caller still traces the ray along d. The second step's d must be the first's.
  template <uint32_t kTraits>
  EnvironmentMap::Place PrepareEnvironment(Vec3f d) const {
    if constexpr (!Has(kTraits, Trait::kEnvironment)) return {};
    return LocateInFirst(*impl_, d);
  }
  template <uint32_t kTraits>
  EnvironmentValueOf<ColorOf<kTraits>> EvalEnvironment(
      Vec3f p, Vec3f n, Vec3f d, const WavelengthsOf<ColorOf<kTraits>>& wavelengths,
      EnvironmentMap::Place place) const {
    if constexpr (!Has(kTraits, Trait::kEnvironment)) return {};
    return FromInfinity<ColorOf<kTraits>>(*impl_, p, n, d, wavelengths, {place});
  }

  // --- For lines through media, where another way to a point than Sample's may lead to it. All in
  // free space (Sample's n is zero).

  // The light that is worth most at p, none where no light reaches it. u: independent of u_select.
  std::optional<ChosenLight> Choose(Vec3f p, float u_select, Vec2f u) const;
  // With which Choose, and Sample, choose the light at p.
  float ChoiceProbability(uint32_t light, Vec3f p) const;
  // Of all lights, from 0 on.
  uint32_t light_count() const;
  // Made from the light at each call.
  LightBounds BoundsOf(uint32_t light) const;
  // Sample, once it has chosen. Requires: chosen.probability is ChoiceProbability at p.
  template <uint32_t kTraits>
  std::optional<LightSampleOf<ColorOf<kTraits>>> SampleChosen(
      const ChosenLight& chosen, Vec3f p, Vec2f u,
      const WavelengthsOf<ColorOf<kTraits>>& wavelengths) const {
    return SampleChosenLight<kTraits & kLightTraits>(*impl_, chosen, p, u, wavelengths);
  }

  // --- Light groups: what follows may be called once AssignGroups was.

  // groups: ascending names, among them those of all lights of the scene.
  void AssignGroups(const SceneDescription& scene, const std::vector<std::string>& groups);
  // Index in `groups` of an emitter, or of LightSample::light.
  uint32_t GroupOf(uint32_t light) const;
  // Adds `light`, which came to p along (unit) d from all infinite lights together, to their
  // groups: to each `weight` times what its lights send, and to the first also what rounding
  // leaves, so that groups still add up.
  template <typename Color>
  void AddByGroup(Vec3f p, Vec3f d, const WavelengthsOf<Color>& wavelengths, const Color& weight,
                  const Color& light, std::vector<Color>* groups) const;

  struct Impl;
  // The traits that make a difference here: one compiled form for each combination.
  static constexpr uint32_t kLightTraits =
      static_cast<uint32_t>(Trait::kEnvironment) | static_cast<uint32_t>(Trait::kDeltaLights) |
      static_cast<uint32_t>(Trait::kAreaLights) | static_cast<uint32_t>(Trait::kQuadrics) |
      static_cast<uint32_t>(Trait::kVaryingEmission) | static_cast<uint32_t>(Trait::kSpectral);

 private:
  LightTable();
  template <uint32_t kMask>
  static std::optional<LightSampleOf<ColorOf<kMask>>> SampleLights(
      const Impl& impl, Vec3f p, Vec3f n, float u_select, Vec2f u,
      const WavelengthsOf<ColorOf<kMask>>& wavelengths, const Preparation& preparation);
  template <uint32_t kMask>
  static std::optional<LightSampleOf<ColorOf<kMask>>> SampleChosenLight(
      const Impl& impl, const ChosenLight& chosen, Vec3f p, Vec2f u,
      const WavelengthsOf<ColorOf<kMask>>& wavelengths);
  // Inlined into those two.
  template <uint32_t kMask>
  [[gnu::always_inline]] static inline std::optional<LightSampleOf<ColorOf<kMask>>> SampleOne(
      const Impl& impl, const ChosenLight& chosen, Vec3f p, Vec3f n, Vec2f u,
      const WavelengthsOf<ColorOf<kMask>>& wavelengths, const Preparation& preparation);
  template <uint32_t kMask>
  static float PdfOfEmitter(const Impl& impl, uint32_t emitter, Vec3f p, Vec3f n, Vec3f wi,
                            Vec3f p_light);
  template <typename Color>
  Color VaryingRadiance(uint32_t emitter, Vec3f ng, Vec3f wo, Vec2f uv,
                        const WavelengthsOf<Color>& wavelengths) const;
  template <typename Color>
  static Color RadianceFromInfinity(const Impl& impl, Vec3f p, Vec3f d,
                                    const WavelengthsOf<Color>& wavelengths);
  // What is known already of a direction, as one of the infinite lights has it.
  struct Located {
    EnvironmentMap::Place place;  // In its map, where it has one.
    uint32_t light = 0;
    float portal_pdf = 0;  // Where it was sampled through the light's portal.
  };
  template <typename Color>
  static EnvironmentValueOf<Color> FromInfinity(const Impl& impl, Vec3f p, Vec3f n, Vec3f d,
                                                const WavelengthsOf<Color>& wavelengths,
                                                const Located& located);
  static EnvironmentMap::Place LocateInFirst(const Impl& impl, Vec3f d);
  static Preparation Prepare(const Impl& impl, Vec2f u);

  std::unique_ptr<Impl> impl_;
};

}  // namespace sheaf::render
