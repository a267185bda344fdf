// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTable: all lights of the scene. Samples a light from a point, and gives the pdf for multiple
// importance sampling when a scattered ray hits a light. Positions are camera-relative (render
// space), as for all geometry.
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
#include "worker/render/light/area_lights.h"
#include "worker/render/light/choice/light_bounds.h"
#include "worker/render/light/choice/light_query.h"
#include "worker/render/light/emission_map.h"
#include "worker/render/light/environment_map.h"

namespace sheaf::render {

// Color: Rgb, or Spectral at the wavelengths of the path.
template <typename Color>
struct LightSampleOf {
  Vec3f wi;             // Unit, from the receiving point to the light.
  Vec3f p_light;        // Point on the light; unused for infinite lights.
  Vec3f p_light_error;  // Bound of the absolute rounding error of p_light.
  Vec3f n_light;        // Geometric normal of area lights, zero otherwise.
  Color radiance;       // Arriving, unoccluded; for delta lights intensity / distance^2.
  float pdf =
      // Per solid angle, times the choice probability of this light; for delta lights only the
      // latter.
      0;
  bool is_delta = false;  // A point or distant light, or one that rays cannot hit: no MIS.
  bool is_infinite = false;
  uint32_t light = 0;  // Index in the table; for infinite lights that of any one of them.
  // Set only if emission varies: the shape (of SceneDescription) whose alpha cut-out the caller
  // must still apply, and the texture coordinates at which to evaluate it.
  int32_t cut_out = kNone;
  Vec2f uv;
};
using LightSample = LightSampleOf<Rgb>;

// Sum of the infinite lights in one direction.
template <typename Color>
struct EnvironmentValueOf {
  Color radiance;
  float pdf = 0;  // Solid angle, times the probability of choosing these lights.
};
using EnvironmentValue = EnvironmentValueOf<Rgb>;

class LightChoice;

struct LightTableInput {
  std::vector<TriangleEmitter> triangles;
  std::vector<SphereEmitter> spheres;
  std::vector<DiskEmitter> disks;
  // Index in details by emitter id, or kNone. Empty where no emission varies.
  std::vector<int32_t> detail_of;
  std::vector<EmissionDetail> details;
  EmissionMaps maps;
  std::vector<Quadric> quadrics;
  bool spectral = false;       // Whether traits with kSpectral may be used.
  bool splits = false;         // Whether traits with kLightSplits may be used.
  bool choose_evenly = false;  // Choose all lights with equal probability, wherever they are.
  Vec3d render_origin_world;   // World position of render space's origin (the camera).
};

class LightTable {
 public:
  // Emitter ids are: triangles first, then spheres, then disks, in input order. Emitters without
  // area or with non-finite values keep their ids and are never sampled. Errors: an unreadable
  // image; a map that is not square; negative or non-finite values (with the texel named); a light
  // whose transform cannot be inverted or distorts an environment map.
  static absl::StatusOr<std::unique_ptr<LightTable>> Build(const SceneDescription& scene,
                                                           LightTableInput input,
                                                           FileSource& files);
  ~LightTable();

  uint64_t memory_bytes() const;
  // The part of the maps of lights from all directions, with their portals.
  uint64_t environment_bytes() const;
  // True where there are no lights, or all of them are black.
  bool empty() const;
  // Chooses a light and samples a point on it, as seen from p. n: the receiver's geometric normal,
  // or zero in free space; guides the choice, and excludes directions to infinite lights behind it.
  // None where the light cannot reach p. Space: render. Never returns pdf 0, a non-finite value or
  // radiance 0. query, here and below: its row is of the region of p, from a LightVisibility with
  // the slots of choice(). Pdfs and samples at a point need the same query. Sample itself takes one
  // sample of all lights, as a query for one does.
  template <TraitBits kTraits>
  std::optional<LightSampleOf<ColorOf<kTraits>>> Sample(
      Vec3f p, Vec3f n, float u_select, Vec2f u,
      const WavelengthsOf<ColorOf<kTraits>>& wavelengths = {}, const LightQuery& query = {}) const {
    return Sample<kTraits>(p, n, u_select, u, wavelengths, PrepareSample<kTraits>(u), query);
  }
  // The same in two steps: Prepare prefetches environment map data while the caller still computes
  // p. Both steps must get the same u.
  struct Preparation {
    EnvironmentMap::PlaceSample sky;
  };
  template <TraitBits kTraits>
  Preparation PrepareSample(Vec2f u) const {
    if constexpr (!Has(kTraits, Trait::kEnvironment)) return {};
    return Prepare(*impl_, u);
  }
  template <TraitBits kTraits>
  std::optional<LightSampleOf<ColorOf<kTraits>>> Sample(
      Vec3f p, Vec3f n, float u_select, Vec2f u, const WavelengthsOf<ColorOf<kTraits>>& wavelengths,
      const Preparation& preparation, const LightQuery& query = {}) const {
    return SampleLights<LightTraitsOf(kTraits)>(*impl_, p, n, u_select, u, wavelengths, preparation,
                                                QueryFor<kTraits>(query));
  }
  // Solid-angle pdf (times the choice probability) with which Sample, called at p with n, would
  // have sampled the point p_light of the emitter along wi. Bit-identical to Sample's; 0 where
  // Sample returns none.
  template <TraitBits kTraits>
  float PdfEmitter(uint32_t emitter, Vec3f p, Vec3f n, Vec3f wi, Vec3f p_light,
                   const LightQuery& query = {}) const {
    return PdfOfEmitter<LightTraitsOf(kTraits)>(*impl_, emitter, p, n, wi, p_light,
                                                QueryFor<kTraits>(query));
  }
  // Radiance of the emitter towards wo (unit, leaving the light) at its surface point with normal
  // ng, which is oriented as LightSample::n_light (outward for spheres, also for inward-emitting
  // ones).
  template <typename Color = Rgb>
  Color EmitterRadiance(uint32_t emitter, Vec3f ng, Vec3f wo,
                        const WavelengthsOf<Color>& wavelengths = {}) const;
  // The same where emission may vary over the surface. uv: texture coordinates.
  template <TraitBits kTraits>
  ColorOf<kTraits> EmitterRadianceAt(uint32_t emitter, Vec3f ng, Vec3f wo, Vec2f uv,
                                     const WavelengthsOf<ColorOf<kTraits>>& wavelengths) const {
    if constexpr (Has(kTraits, Trait::kTexturedEmission)) {
      return TexturedRadiance<ColorOf<kTraits>>(emitter, ng, wo, uv, wavelengths);
    } else {
      return EmitterRadiance<ColorOf<kTraits>>(emitter, ng, wo, wavelengths);
    }
  }
  // Sum over all infinite lights as seen from p along the unit direction d, and Sample's pdf of it.
  // It depends on p only where lights have portals.
  template <TraitBits kTraits>
  ColorOf<kTraits> EnvironmentRadiance(
      Vec3f p, Vec3f d, const WavelengthsOf<ColorOf<kTraits>>& wavelengths = {}) const {
    if constexpr (!Has(kTraits, Trait::kEnvironment)) return {};
    return RadianceFromInfinity<ColorOf<kTraits>>(*impl_, p, d, wavelengths);
  }
  template <TraitBits kTraits>
  float PdfEnvironment(Vec3f p, Vec3f n, Vec3f d, const LightQuery& query = {}) const {
    if constexpr (!Has(kTraits, Trait::kEnvironment)) return 0;
    return FromInfinity<Rgb>(*impl_, p, n, d, {}, {LocateInFirst(*impl_, d)},
                             QueryFor<kTraits>(query))
        .pdf;
  }
  // The same of one infinite light: from first_infinite() to light_count() - 1.
  uint32_t first_infinite() const;
  template <typename Color>
  Color RadianceOfInfinite(uint32_t light, Vec3f p, Vec3f d,
                           const WavelengthsOf<Color>& wavelengths) const;
  // Both at once, at little more than the cost of one.
  template <TraitBits kTraits>
  EnvironmentValueOf<ColorOf<kTraits>> EvalEnvironment(
      Vec3f p, Vec3f n, Vec3f d, const WavelengthsOf<ColorOf<kTraits>>& wavelengths = {},
      const LightQuery& query = {}) const {
    return EvalEnvironment<kTraits>(p, n, d, wavelengths, PrepareEnvironment<kTraits>(d), query);
  }
  // The same in two steps: PrepareEnvironment prefetches environment map data while the caller
  // still traces the ray along d. Both steps must get the same d.
  template <TraitBits kTraits>
  EnvironmentMap::Place PrepareEnvironment(Vec3f d) const {
    if constexpr (!Has(kTraits, Trait::kEnvironment)) return {};
    return LocateInFirst(*impl_, d);
  }
  template <TraitBits kTraits>
  EnvironmentValueOf<ColorOf<kTraits>> EvalEnvironment(
      Vec3f p, Vec3f n, Vec3f d, const WavelengthsOf<ColorOf<kTraits>>& wavelengths,
      EnvironmentMap::Place place, const LightQuery& query = {}) const {
    if constexpr (!Has(kTraits, Trait::kEnvironment)) return {};
    return FromInfinity<ColorOf<kTraits>>(*impl_, p, n, d, wavelengths, {place},
                                          QueryFor<kTraits>(query));
  }

  // --- For equiangular sampling in media, which may reach a point on another path than Sample's.
  // All functions are for receivers in free space (Sample's n is zero).

  // Chooses a light by its weight at p, none where no light reaches p. u: independent of u_select.
  std::optional<ChosenLight> Choose(Vec3f p, float u_select, Vec2f u) const;
  std::optional<ChosenLight> Choose(Vec3f p, float u_select, Vec2f u, LightVisibilityRow row) const;
  // The probability with which Choose and Sample choose the light at p. n: as for Sample.
  float ChoiceProbability(uint32_t light, Vec3f p, Vec3f n = {}) const;
  float ChoiceProbability(uint32_t light, Vec3f p, Vec3f n, LightVisibilityRow row) const;
  // Lights have the indices [0, light_count()).
  uint32_t light_count() const;
  // The index in SceneDescription::lights of a light without a shape; kNone for the others.
  int32_t DescriptionOf(uint32_t light) const;
  // Computed from the light at each call.
  LightBounds BoundsOf(uint32_t light) const;
  // Samples the chosen light. Requires: chosen.probability is ChoiceProbability at p.
  template <TraitBits kTraits>
  std::optional<LightSampleOf<ColorOf<kTraits>>> SampleChosen(
      const ChosenLight& chosen, Vec3f p, Vec2f u,
      const WavelengthsOf<ColorOf<kTraits>>& wavelengths, LightVisibilityRow row = {}) const {
    return SampleChosenLight<LightTraitsOf(kTraits)>(*impl_, chosen, p, {}, u, wavelengths,
                                                     QueryFor<kTraits>(row));
  }
  // The same as seen from a surface with normal n, for a light that choice().ChooseFrom chose from
  // a part of the query's cut. Requires: Trait::kLightSplits.
  template <TraitBits kTraits>
  std::optional<LightSampleOf<ColorOf<kTraits>>> SampleOfPart(
      const ChosenLight& chosen, Vec3f p, Vec3f n, Vec2f u,
      const WavelengthsOf<ColorOf<kTraits>>& wavelengths, const LightQuery& query) const {
    static_assert(Has(kTraits, Trait::kLightSplits));
    return SampleChosenLight<LightTraitsOf(kTraits)>(*impl_, chosen, p, n, u, wavelengths,
                                                     QueryFor<kTraits>(query));
  }
  // The choice among the lights, whose slots a LightVisibility learns.
  const LightChoice& choice() const;

  // --- Light groups. Requires: AssignGroups was called before.

  // groups: names in ascending order, which include those of all lights of the scene.
  void AssignGroups(const SceneDescription& scene, const std::vector<std::string>& groups);
  // Index in `groups` of the group of an emitter, or of LightSample::light.
  uint32_t GroupOf(uint32_t light) const;
  // Adds `light`, the radiance that reached p along the unit direction d from all infinite lights
  // together, to their groups: `weight` times the radiance of each group's lights, and to the first
  // group also the rounding residue, so that the groups still sum to the whole. Adds nothing where
  // there is no infinite light.
  template <typename Color>
  void AddByGroup(Vec3f p, Vec3f d, const WavelengthsOf<Color>& wavelengths, const Color& weight,
                  const Color& light, std::vector<Color>* groups) const;

  struct Impl;
  // For the other files of this folder: light_table_impl.h.
  const Impl& impl() const { return *impl_; }
  // The traits that matter here: one instantiation for each combination.
  static constexpr TraitBits kLightTraits =
      static_cast<TraitBits>(Trait::kEnvironment) | static_cast<TraitBits>(Trait::kDeltaLights) |
      static_cast<TraitBits>(Trait::kAreaLights) | static_cast<TraitBits>(Trait::kQuadrics) |
      static_cast<TraitBits>(Trait::kTexturedEmission) | static_cast<TraitBits>(Trait::kSpectral) |
      static_cast<TraitBits>(Trait::kGuiding) | static_cast<TraitBits>(Trait::kLightSplits) |
      static_cast<TraitBits>(Trait::kLearnedLights);
  static constexpr TraitBits LightTraitsOf(TraitBits traits) { return traits & kLightTraits; }

 private:
  LightTable();
  template <TraitBits kMask>
  static std::optional<LightSampleOf<ColorOf<kMask>>> SampleLights(
      const Impl& impl, Vec3f p, Vec3f n, float u_select, Vec2f u,
      const WavelengthsOf<ColorOf<kMask>>& wavelengths, const Preparation& preparation,
      LightQueryOf<kMask> query);
  template <TraitBits kMask>
  static std::optional<LightSampleOf<ColorOf<kMask>>> SampleChosenLight(
      const Impl& impl, const ChosenLight& chosen, Vec3f p, Vec3f n, Vec2f u,
      const WavelengthsOf<ColorOf<kMask>>& wavelengths, LightQueryOf<kMask> query);
  // Inlined into both.
  template <TraitBits kMask>
  [[gnu::always_inline]] static inline std::optional<LightSampleOf<ColorOf<kMask>>> SampleOne(
      const Impl& impl, const ChosenLight& chosen, Vec3f p, Vec3f n, Vec2f u,
      const WavelengthsOf<ColorOf<kMask>>& wavelengths, const Preparation& preparation,
      LightQueryOf<kMask> query);
  template <TraitBits kMask>
  static float PdfOfEmitter(const Impl& impl, uint32_t emitter, Vec3f p, Vec3f n, Vec3f wi,
                            Vec3f p_light, LightQueryOf<kMask> query);
  template <typename Color>
  Color TexturedRadiance(uint32_t emitter, Vec3f ng, Vec3f wo, Vec2f uv,
                         const WavelengthsOf<Color>& wavelengths) const;
  template <typename Color>
  static Color RadianceFromInfinity(const Impl& impl, Vec3f p, Vec3f d,
                                    const WavelengthsOf<Color>& wavelengths);
  // Known properties of a direction, relative to one infinite light.
  struct Located {
    EnvironmentMap::Place place;  // In the light's map, if it has one.
    uint32_t light = 0;
    float portal_pdf = 0;  // Pdf of the light's portal, if it sampled the direction.
  };
  // Query: LightQueryOf some traits.
  template <typename Color, typename Query>
  static EnvironmentValueOf<Color> FromInfinity(const Impl& impl, Vec3f p, Vec3f n, Vec3f d,
                                                const WavelengthsOf<Color>& wavelengths,
                                                const Located& located, Query query);
  static EnvironmentMap::Place LocateInFirst(const Impl& impl, Vec3f d);
  static Preparation Prepare(const Impl& impl, Vec2f u);

  std::unique_ptr<Impl> impl_;
};

}  // namespace sheaf::render
