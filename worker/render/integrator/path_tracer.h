// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer: one sample of one pixel, by unidirectional path tracing with next-event estimation.
// At each vertex a light is sampled, and the scattered ray may meet a light; the two are combined
// by multiple importance sampling. Source: Kajiya 1986; Veach 1997, ch. 8-10; depth is counted as
// in pbrt-v4's path integrator: a path has at most max_depth scattering events, emission seen
// directly has none.
//
// Compiled for each trait combination of variant_list.h: code that a scene does not call for is not
// there. The tracer is a parameter, so that a benchmark can record the rays.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "common/film/film_tile.h"
#include "worker/render/bsdf/surface_tilt.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/color/wavelengths.h"
#include "worker/render/geometry/crossing.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/integrator/direct_light.h"
#include "worker/render/integrator/first_hit.h"
#include "worker/render/integrator/light_groups.h"
#include "worker/render/integrator/path_history.h"
#include "worker/render/integrator/ray_counts.h"
#include "worker/render/material/matter_paint.h"
#include "worker/render/medium/free_flight.h"
#include "worker/render/medium/medium.h"
#include "worker/render/medium/medium_line.h"
#include "worker/render/plan/path_limits.h"
#include "worker/render/sampling/dimensions.h"
#include "worker/render/sampling/mis.h"
#include "worker/render/sampling/sampler.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight = DirectLight::kByBoth>
class PathTracer {
 public:
  // All three must outlive *this. Not thread-safe: one for each thread.
  PathTracer(const CompiledScene& scene, Tracer& tracer, RayCounts& counts)
      : scene_(scene), tracer_(tracer), counts_(counts) {}

  // A pure function of (scene, pixel, sample_index).
  FilmSample TraceSample(int32_t x, int32_t y, uint64_t sample_index);
  // Where TraceSample leaves what the scene's settings ask for besides; cleared by the caller.
  // Variants without kOutputs leave nothing.
  void set_outputs(OutputSample* outputs) {
    outputs_ = outputs;
    groups_.Reset(scene_.settings.outputs);
  }

 private:
  static constexpr bool kMayPass = Has(kTraits, Trait::kAlpha);
  static constexpr bool kSpectral = Has(kTraits, Trait::kSpectral);
  static constexpr bool kOutputs = Has(kTraits, Trait::kOutputs);
  static constexpr bool kMapsNormals = Has(kTraits, Trait::kNormalMaps);
  static constexpr bool kMedia = (kTraits & kInsides) != 0;
  static constexpr bool kNested = Has(kTraits, Trait::kNestedDielectrics);
  static constexpr bool kSubsurface = Has(kTraits, Trait::kSubsurface);
  static constexpr bool kPaintsMatter = kSubsurface && Has(kTraits, Trait::kTextures);
  static constexpr bool kChromaticMedia = Has(kTraits, Trait::kChromaticMedia);
  // Whether segments in media gather light along them: path_tracer_lines.h.
  static constexpr bool kLines = Has(kTraits, Trait::kMedia) && (Has(kTraits, Trait::kAreaLights) ||
                                                                 Has(kTraits, Trait::kDeltaLights));
  static constexpr bool kVaryingMedia = kMedia && Has(kTraits, Trait::kHeterogeneousMedia);
  static constexpr bool kVaryingLines = kLines && kVaryingMedia;
  static constexpr bool kSamplesGlow = kVaryingMedia && Has(kTraits, Trait::kEmissiveMedia);
  static constexpr bool kUsesBoth =
      kDirectLight == DirectLight::kByBoth || kDirectLight == DirectLight::kByLines;
  // What asks for no colour, or for the colour as RGB, leaves the wavelengths out.
  static constexpr uint32_t kRgbTraits = kTraits & ~TraitSet(Trait::kSpectral);

  using Color = ColorOf<kTraits>;

  // A surface that is so near to a path in a medium that rounding could take it across. n is unit,
  // to the side where the path is.
  struct NearPlane {
    Vec3f p, n;
    bool is_set = false;
    float p_error = 0;  // Of p along n, for matter.
  };
  struct InVacuum {};
  using Line = MediumLine<Color>;
  struct NoLine {};
  // What the path is in, and what that does to light.
  struct InMedia {
    // Ranks of the shapes with a priority that it is inside of. The medium of the highest is in
    // `set`.
    [[no_unique_address]] std::conditional_t<kNested, MediumSet, InVacuum> interiors;
    MediumSet set;
    MediumMix<Color> mix;
    uint32_t scatterings = 0;  // So far.
    NearPlane near;
    Crossing last;                                                        // Of a boundary.
    Vec3f camera_o;                                                       // Where the path began.
    [[no_unique_address]] std::conditional_t<kLines, Line, NoLine> line;  // That led to its vertex.
    [[no_unique_address]] MatterPaint<Color, kPaintsMatter> paint;
  };
  // A path in matter: path_tracer_matter.h.
  struct InMatter {
    uint32_t steps = 0;   // Vertices so far.
    uint32_t vertex = 0;  // The last one's, for its slots.
    // Of the true place from the rounded one, or from near.p where the walk is next to it.
    Vec3d offset{};
    bool is_near = false;      // The walk goes on before a plane, without rays.
    bool has_arrived = false;  // The ray leads to the boundary, which the path meets along:
    Vec3f arrives_along;
  };

  struct Path {
    Ray ray;
    [[no_unique_address]] WavelengthsOf<Color> wavelengths;
    Color throughput = Color::Grey(1);
    Color radiance;
    float eta_scale = 1;  // Radiance gained by entering denser matter, which roulette disregards.
    uint32_t depth = 0;   // Scattering events so far.
    bool hero_alone = false;          // Spectral: after dispersion.
    bool specular = true;             // No light sampling could have found what the ray meets.
    float pdf = 0;                    // Of the ray's direction, where not specular.
    Vec3f from, from_n;               // Where the ray began, and the hint of light sampling there.
    EnvironmentMap::Place sky_place;  // Of the ray's direction, once scattered.
    [[no_unique_address]] std::conditional_t<kMedia, InMedia, InVacuum> media;
    [[no_unique_address]] std::conditional_t<kSubsurface, InMatter, InVacuum> matter;
    [[no_unique_address]] std::conditional_t<kOutputs, PathHistory, NoHistory> history;
  };

  // Numbers to sample a light with, and what could be begun with them alone.
  struct LightDraw {
    std::array<float, 4> u;
    LightTable::Preparation preparation;
  };

  LightDraw DrawLight(const Sampler& sampler, uint32_t depth) const {
    LightDraw draw{sampler.Get4(Slot(depth, VertexSlot::kLight)), {}};
    draw.preparation = scene_.lights->template PrepareSample<kTraits>({draw.u[0], draw.u[1]});
    return draw;
  }

  // What decides at a surface that may let rays pass: uniform, independent for each pass.
  struct PassChoice {
    float cut_out, mix;
  };
  static PassChoice ChoiceAt(const Sampler& sampler, const Surface& surface, uint32_t passes,
                             const Path& path);
  static PassChoice MakeChoice(std::array<float, 2> u, uint32_t pass);

  // Of a vertex where maps may have turned the normal.
  struct NoTilt {};
  using Tilt = std::conditional_t<kMapsNormals, SurfaceTilt, NoTilt>;
  using Plane = std::conditional_t<kMapsNormals, std::optional<TangentPlane>, NoTilt>;

  // *weight: as Camera::MakeRay's.
  Ray CameraRay(const Sampler& sampler, int32_t x, int32_t y, FilmSample* film,
                float* weight) const;
  void Trace(const Sampler& sampler, Path* path, FilmSample* film);
  void RecordSurface(const BsdfOf<Color>& bsdf, const SurfacePoint& point, float u_mix,
                     const Path& path, Vec3f camera_o, FilmSample* film) const;
  TexturePoint TexturePointOf(const SurfacePoint& point) const;
  bool IsCutOut(const SurfacePoint& point, float u) const;
  void AddEscape(Path* path);
  // Requires: the point is an emitter's.
  void AddEmission(const SurfacePoint& point, Path* path);
  // Adds light that came from the one light to the path, and to the light's group.
  void AddLight(uint32_t light, LightPathKind kind, const Color& radiance, Path* path) {
    path->radiance += radiance;
    if constexpr (kOutputs) groups_.Add(*scene_.lights, light, kind, radiance);
  }
  // The same for weight times what all infinite lights together send to p along d.
  void AddSky(Vec3f p, Vec3f d, const Color& weight, LightPathKind kind, const Color& radiance,
              Path* path) {
    path->radiance += radiance;
    if constexpr (kOutputs) {
      groups_.AddSky(*scene_.lights, p, d, path->wavelengths, weight, kind, radiance);
    }
  }
  // bsdf's albedo as RGB. u_mix: as Evaluate's.
  Rgb AlbedoOf(const BsdfOf<Color>& bsdf, const SurfacePoint& point, float u_mix) const;
  // How much of a light that is cut out where the sample is remains of it there.
  float ShareOfCutOut(const LightSampleOf<Color>& light) const;
  // Turns the shading frame as the material's map says, for wo. u_mix: as Evaluate's.
  Tilt MapNormal(const Sampler& sampler, const TangentPlane& plane, float u_mix, uint32_t depth,
                 Vec3f wo, SurfacePoint* point) const;
  // Shading and true normal must agree on the side of a direction, given its cosines with them, or
  // light would leak through the surface. Tilted normals see to that themselves, and light goes
  // through hair.
  static bool AgreesOnSide(const BsdfOf<Color>& bsdf, [[maybe_unused]] const Tilt& tilt,
                           float cos_shading, float cos_true) {
    if constexpr (kMapsNormals) {
      if (tilt.active()) return true;
    }
    return IsHair<kTraits>(bsdf) || cos_shading * cos_true > 0;
  }
  // What the surface scatters from w, with the pdf of Scatter's choosing it.
  static BsdfValueOf<Color> ValueTowards(Vec3f w, const SurfacePoint& point, const Tilt& tilt,
                                         const BsdfOf<Color>& bsdf, Vec3f wo_local);
  void AddDirect(const LightDraw& draw, const SurfacePoint& point, const Tilt& tilt,
                 const BsdfOf<Color>& bsdf, Vec3f wo_local, Vec3f light_hint, Path* path);
  // Whether light may arrive at a surface from behind it.
  static bool TransmitsLight(const BsdfOf<Color>& bsdf) {
    return IsHair<kTraits>(bsdf) ||
           (Has(kTraits, Trait::kSpecularTransmission) &&
            (bsdf.kind == BsdfKind::kDielectric || bsdf.kind == BsdfKind::kThinDielectric ||
             bsdf.kind == BsdfKind::kDiffuseTransmission));
  }
  // Refraction leads each wavelength elsewhere: the path goes on with the hero, for all four.
  static void FollowHero(Path* path) {
    if (path->hero_alone) return;
    path->hero_alone = true;
    path->throughput = {{path->throughput[0] * kWavelengthCount}};
  }
  // Goes on along a sampled direction. False where the path ends.
  bool Scatter(const Sampler& sampler, const SurfacePoint& point, const Tilt& tilt,
               const BsdfOf<Color>& bsdf, Vec3f wo_local, Vec3f light_hint, Path* path) const;
  // The share of a contribution that goes to the technique that found it with `pdf`, where the
  // other would have done so with `other_pdf`.
  static float SampledShare(float pdf, float other_pdf) {
    if constexpr (kUsesBoth) return PowerHeuristic(pdf, other_pdf);
    return kDirectLight == DirectLight::kBySampling ? 1 : 0;
  }
  static float MetShare(float pdf, float other_pdf) {
    if constexpr (kUsesBoth) return PowerHeuristic(pdf, other_pdf);
    return kDirectLight == DirectLight::kByMeeting ? 1 : 0;
  }
  // Of a light that was sampled, and would have been met with `pdf`.
  static float ShareOfSample(const LightSampleOf<Color>& light, float pdf) {
    return light.is_delta ? 1.0f : SampledShare(light.pdf, pdf);
  }
  // What share of a light that was sampled adds at p.
  void AddSampled(const LightSampleOf<Color>& light, Vec3f p, const Color& f_cos, float share,
                  LightPathKind kind, Path* path);
  // False where chance ends a path that carries little.
  bool SurvivesRoulette(float u, Path* path) const;
  // From the point to the light. *end is set for lights that have a place.
  static Ray ShadowRay(const SurfacePoint& point, const LightSampleOf<Color>& light, float time,
                       Vec3f* end);
  bool IsVisible(const SurfacePoint& point, const LightSampleOf<Color>& light,
                 std::array<float, 2> u_pass, float time);
  bool IsVisibleThroughCutOuts(Ray ray, bool is_infinite, Vec3f end, std::array<float, 2> u_pass);
  // Whether the surface lets the choice-th ray pass that comes by for light.
  bool LetsPass(const SurfacePoint& point, PassChoice choice) const;

  // Whose slots the next vertex draws from, and the last.
  static uint32_t NextVertex(const Path& path) {
    if constexpr (kSubsurface) {
      return path.media.mix.is_matter ? kMatterVertex + path.matter.steps : path.depth;
    }
    return path.depth;
  }
  static uint32_t LastVertex(const Path& path) {
    if constexpr (kSubsurface) return path.matter.vertex;
    return path.depth - 1;
  }
  // Counts a vertex. in_matter: of a walk, or of a boundary from below. False where the path ends.
  bool CountVertex(bool in_matter, Path* path);

  // path_tracer_matter.h.
  // Whether the path comes to the boundary of the matter it is in; then it does so along its walk.
  static bool ArriveInMatter(const Surface& surface, Path* path);
  // Requires: path->matter.is_near. Takes the path before its plane to where it meets that, or
  // farther away. False where the path ends.
  bool WalkNearPlane(const Sampler& sampler, Path* path);
  // The vertex in a medium is truly at place, and p is what that was rounded to.
  static void PlaceInMatter(Vec3d place, Vec3f p, Path* path);
  // The same at a surface, which the path has entered or not left.
  static void StartAtBoundary(const SurfacePoint& point, Path* path);
  static bool IsFine(const Path& path);

  // path_tracer_interiors.h.
  enum class BoundaryKind : uint8_t {
    kPlain,   // Of no matter with a priority.
    kMatter,  // Between matter of the surface's rank and of rank `other`.
    kHidden,  // Not there, as other matter is on both sides of it.
    kBroken,  // Left from where it had not been entered; counted.
  };
  struct Boundary {
    BoundaryKind kind = BoundaryKind::kPlain;
    uint16_t other = kNoRank;
  };
  // What a ray along d meets at the point.
  Boundary BoundaryAt(const SurfacePoint& point, Vec3f d, const InMedia& media) const;
  // The same for the ray of the path; bsdf becomes that between the two matters. kHidden also where
  // their indices are the same.
  BoundaryKind MeetInterior(const SurfacePoint& point, const Path& path, BsdfOf<Color>* bsdf) const;
  bool LetsPassByPriority(const SurfacePoint& point, Vec3f d, const Path& path,
                          const InMedia& media) const;
  // Cross for a surface with a rank. False where the nesting is broken.
  bool CrossInterior(const Surface& surface, bool enters, InMedia* media) const;

  // path_tracer_media.h.
  enum class Travel : uint8_t { kArrived, kScattered, kEnded };
  void StartInMedia(Path* path) const;
  // Counts one in *media; after so many as the settings say, what follows is in their reduced form.
  void CountScattering(const Path& path, InMedia* media) const;
  // Mixes what *media holds now, in the form that it has.
  void MixAgain(const Path& path, InMedia* media) const {
    media->mix = scene_.media->template MixOf<Color>(media->set, path.wavelengths, media->mix.form,
                                                     media->paint.OrNull());
  }
  // Adds what the media shine with along `length`.
  void AddGlow(const Sampler& sampler, uint32_t passes, double length, Path* path);
  // Takes path and path->ray through the media up to `hit` (null: without end), or to where they
  // scatter it; then the path is ready to be traced on. *passes: surfaces passed since the
  // last vertex.
  Travel TravelThroughMedia(const Sampler& sampler, const RawHit* hit, uint32_t* passes,
                            bool* is_first, Path* path, FilmSample* film);
  // Where media vary: which of them scatters the path, if not those that are the same everywhere.
  using Scatterer = std::optional<uint16_t>;
  bool ScatterInMedium(const Sampler& sampler, Vec3f p, Scatterer scatterer, Path* path);
  Vec3f PointInMedium(const Ray& ray, const RawHit* hit, double t, NearPlane* near) const;
  void RecordMedium(Vec3f p, Scatterer scatterer, const Path& path, FilmSample* film) const;
  // Changes what *media is in where a ray along w leaves the surface from the other side. False
  // where the nesting of media is broken, which is counted.
  bool Cross(const SurfacePoint& point, Vec3f w, const Path& path, InMedia* media) const;
  // Takes the media of both sides in, for a path that meets them and goes on from one of them.
  bool MeetMedia(const SurfacePoint& point, bool from_front, bool to_front, const Path& path,
                 InMedia* media) const;
  // As Cross, where the ray comes in along path.ray and may stay on its side.
  bool CrossOrStay(const SurfacePoint& point, Vec3f w, bool is_hair, const Path& path,
                   InMedia* media) const;
  // What of the light arrives at the point, by way of media and surfaces that let it pass.
  Color ShareThroughMedia(const SurfacePoint& point, const LightSampleOf<Color>& light,
                          std::array<float, 2> u_pass, const Path& path, InMedia media);
  // The same along a shadow ray, to `end` where that is not null. on_segment(ray, pass, length,
  // share, media) is called where each segment begins, with what share of its light arrives.
  template <typename OnSegment>
  Color PassThroughMedia(Ray ray, const Vec3f* end, std::array<float, 2> u_pass, const Path& path,
                         InMedia media, const OnSegment& on_segment);

  // path_tracer_glow.h. Where kSamplesGlow.
  // Adds what media shine with along one ray from a vertex. towards(w, &media): a
  // BsdfValueOf<Color> of the direction w; media becomes that on its side.
  template <typename Towards>
  void AddSampledGlow(const Sampler& sampler, const SurfacePoint& point, const Towards& towards,
                      Path* path);
  void AddGlowAtSurface(const Sampler& sampler, const SurfacePoint& point, const Tilt& tilt,
                        const BsdfOf<Color>& bsdf, Vec3f wo_local, Path* path);
  // The share of glow that the path's ray meets.
  float MetShareOfGlow(const Path& path) const;

  // path_tracer_lines.h. Where kLines.
  static bool GathersAlongLines(const MediumMix<Color>& m) {
    return (m.scatters || (kVaryingLines && m.gathers)) && !m.is_matter;
  }
  Line LineOf(const Path& path, double length) const;
  // Where on the line the light's light is gathered. None where that does not pay.
  std::optional<EquiangularDistances> DistancesOn(const Line& line, uint32_t light) const;
  void EndLine(const Line& line, double t, Scatterer scatterer, Path* path) const;  // At t.
  PhaseMix<Color> PhaseOnLine(const Line& line, double t, const Path& path) const;
  // The density, per distance along the line and solid angle at p (delta lights: probability), with
  // which AddLightAlong finds p, at t, and a point of the light that Sample finds from there with
  // pdf_sampled. 0 where it finds nothing of the light.
  double PdfByLine(const Line& line, uint32_t light, Vec3f p, double t, float pdf_sampled) const;
  // SampledShare and MetShare at p, where the path was scattered on the line.
  float SampledShareOnLine(const Line& line, const LightSampleOf<Color>& light, Vec3f p,
                           float pdf) const;
  float MetShareOnLine(const Line& line, uint32_t emitter, float sampled_pdf,
                       const Path& path) const;
  // What share of the light that comes to t is scattered along the line, times *weight; left: what
  // of the throughput is left there by media that are the same everywhere.
  Color ScatteredOnLine(const Line& line, double t, const Color& left,
                        const LightSampleOf<Color>& light, double line_pdf, const Path& path,
                        double* weight) const;
  // Adds light from one light that is scattered once on the way to the line's beginning.
  void AddLightAlong(const Sampler& sampler, const Line& line, const RawHit* hit, uint32_t passes,
                     Path* path);

  // path_tracer_varying.h. In media some of which vary, along a ray up to `length`.
  Flight<Color> FlyThroughVarying(const Ray& ray, const std::array<float, 4>& u, uint32_t passes,
                                  double length, const Path& path, Scatterer* scatterer);
  Color ShareThroughVarying(const Ray& ray, std::array<float, 2> u, uint32_t pass, double length,
                            const Path& path, const InMedia& media);
  // What arrives at the beginning of the ray of all that shines along `length`.
  Color EmissionAmongVarying(const Ray& ray, const std::array<float, 4>& u, uint32_t passes,
                             double length, const Path& path, const InMedia& media);

  const CompiledScene& scene_;
  Tracer& tracer_;
  RayCounts& counts_;
  OutputSample* outputs_ = nullptr;
  LightGroups<Color> groups_;
};

// --- Definitions ---------------------------------------------------------------------------------

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
FilmSample PathTracer<kTraits, Tracer, kDirectLight>::TraceSample(int32_t x, int32_t y,
                                                                  uint64_t sample_index) {
  const Sampler sampler(scene_.settings.seed, x, y, sample_index, scene_.settings.one_sequence);
  FilmSample film;
  Path path;
  float weight = 1;
  path.ray = CameraRay(sampler, x, y, &film, &weight);
  // What a lens holds back is dark, and a sample like others.
  if (Has(kTraits, Trait::kLens) && weight == 0) return film;
  if constexpr (Has(kTraits, Trait::kEnvironment)) path.from = path.ray.o;
  if constexpr (kSpectral) {
    path.wavelengths = Wavelengths::Sample(sampler.Get1(Slot(CameraSlot::kWavelength)));
  }
  if constexpr (kMedia) StartInMedia(&path);
  Trace(sampler, &path, &film);
  film.radiance = scene_.film.Of(path.radiance, path.wavelengths);
  if constexpr (Has(kTraits, Trait::kLens)) film.radiance *= weight;
  scene_.film.Clamp(&film.radiance, &weight);
  if constexpr (kOutputs) {
    groups_.MoveTo(
        outputs_, [&](const Color& sum) { return scene_.film.Of(sum, path.wavelengths) * weight; });
  }
  return film;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
Ray PathTracer<kTraits, Tracer, kDirectLight>::CameraRay(const Sampler& sampler, int32_t x,
                                                         int32_t y, FilmSample* film,
                                                         float* weight) const {
  Vec2f filter_u, lens_u;
  if constexpr (Has(kTraits, Trait::kLens)) {
    const std::array<float, 4> u = sampler.Get4(Slot(CameraSlot::kFilterAndLens));
    filter_u = {u[0], u[1]};
    lens_u = {u[2], u[3]};
  } else {
    filter_u = sampler.Get2(Slot(CameraSlot::kFilterAndLens));
  }
  const float time = Has(kTraits, Trait::kMotion)
                         ? scene_.camera.ShutterFraction(sampler.Get1(Slot(CameraSlot::kTime)))
                         : 0;
  const FilterSample filtered = scene_.filter.Sample(filter_u);
  film->filter_weight = filtered.weight;
  const Vec2d raster{x + 0.5 + static_cast<double>(filtered.offset.x),
                     y + 0.5 + static_cast<double>(filtered.offset.y)};
  return scene_.camera.template MakeRay<kTraits>(raster, lens_u, time, weight);
}

}  // namespace sheaf::render

#include "worker/render/integrator/path_tracer_glow.h"
#include "worker/render/integrator/path_tracer_interiors.h"
#include "worker/render/integrator/path_tracer_lines.h"
#include "worker/render/integrator/path_tracer_matter.h"
#include "worker/render/integrator/path_tracer_media.h"
#include "worker/render/integrator/path_tracer_scattering.h"
#include "worker/render/integrator/path_tracer_surface.h"
#include "worker/render/integrator/path_tracer_varying.h"
#include "worker/render/integrator/path_tracer_visibility.h"
