// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Weights of the techniques by which paths from the camera and from lights find the same light.
// A path is x0 (lens), x1 ... xk (light). It is found by scattering that hits xk, by a sample of
// the light at x(k-1), or by a light path that is connected from x1 to the lens. With the steps of
// RunningDensity, the densities per area of the whole path have the ratio
//
//   light path / scattering = n / PdfWe(x1) * E * product i=1..k-1 of the steps,
//
// where x1 has no backward density. Where light paths are merged (merge.h), a path whose x1 ...
// x(m-1) are specular, m >= 2, is found by a light path that arrives within the radius r of xm, the
// first rough vertex:
//
//   light path / scattering = n pi r^2 |cos(xm, x(m-1))| * E * product i=m..k-1 of the steps,
//
// where xm has no backward density. So light paths find each path in at most one way.
//
// n: light paths while each pixel sends one camera ray; E: GuidedEmission::DensityAt, and for the
// emission of media, of which x(k-1) sees all along one line, MediaDensityAt. Both E and PdfWe are
// per area that faces the ray. For a sampled light, its pdf takes the place of forward(k-1). A line
// sample (equiangular_sampling.h) is a light sample whose density is LineOverSample times as large.
//
// The densities of light samples and line samples at x(k-1) depend on what a light path meets after
// that vertex, its first: the number of light samples on the number of vertices, a line on the
// place where the camera's segment begins. The light path carries the former for each number, and
// finds the latter on its way; until then its first vertex is open (LightEnd::is_open). Sources:
// Veach 1997, ch. 9 and 10; docs/adr/0063, 0127.
//
// A vertex is a SurfaceVertex or a MediumVertex.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "common/math/elementary.h"
#include "worker/render/densities/weights.h"
#include "worker/render/gather/may_merge.h"
#include "worker/render/gather/merging.h"
#include "worker/render/integrator/context.h"
#include "worker/render/integrator/light_splits.h"

namespace sheaf::render {

// --- Emission of media ---------------------------------------------------------------------------

// Its E: the density of light paths that begin in media and reach p along -w.
template <typename C>
double MediaDensityAt(const Context<C>& c, Vec3f p, Vec3f w) {
  const EmissionPoints* points = c.scene.emission_points.get();
  if (points == nullptr || points->empty()) return 0;
  return c.emission.MediaProbability(-w) * points->LineDensity(p, w) / (4 * kPi);
}

// The pdf with which a vertex at p samples the direction w by the emission of media.
template <typename C>
double MediaPdf([[maybe_unused]] const Context<C>& c, [[maybe_unused]] Vec3f p,
                [[maybe_unused]] Vec3f w) {
  if constexpr (C::kHeterogeneous && C::Has(Trait::kEmissiveMedia)) {
    const EmissiveVolumeSampler& lights = c.scene.media->emissive_volumes();
    if (!lights.empty()) return static_cast<double>(lights.Pdf(p, w));
  }
  return 0;
}

// --- Paths from the camera -----------------------------------------------------------------------

// The light paths that meet the path's first vertex, p, while a camera path does.
template <typename C>
double LightPathsAtFirst(const Context<C>& c, Vec3f p, const PathState<C>& path) {
  Ray camera_ray = path.ray;
  camera_ray.o = path.camera_o;
  const double seen = c.scene.camera.PdfWe(camera_ray, p);
  return seen > 0 ? c.scene.light_paths_per_pass / seen : 0;
}

// At the path's first vertex, p.
template <typename C>
void StartOtherEnd(const Context<C>& c, Vec3f p, PathState<C>* path) {
  if constexpr (C::kPathKind == PathKind::kCameraBesideLight) {
    CameraEnd& end = path->other_end;
    end.light_paths.Start(LightPathsAtFirst(c, p, *path));
    end.is_in_prefix = c.scene.gather_step > 0;
    end.camera_d = path->ray.d;
  }
}

// The state of the path as if it had a vertex at p, in a medium.
template <typename C>
CameraEnd EndAt(const Context<C>& c, Vec3f p, const PathState<C>& path) {
  CameraEnd end = path.other_end;
  if (path.is_camera_path) end.light_paths.Start(LightPathsAtFirst(c, p, path));
  return end;
}

// The light paths of a pass that are merged at a vertex where a unit of area receives one.
template <typename C>
double MergedLightPaths(const Context<C>& c, float radius) {
  const auto r = static_cast<double>(radius);
  return c.scene.light_paths_per_pass * kPi * r * r / c.scene.gather_step;
}

// The radius of weights at the vertex, at the end of a camera path of specular vertices; 0 where
// light paths are not merged. Surfaces whose BSDF is chosen at random are left to camera paths:
// both ends would choose.
template <typename C, typename Vertex>
float MergeRadiusAt(const Context<C>& c, const Vertex& vertex, const PathState<C>& path) {
  const Surface& surface = *vertex.point.surface;
  if (surface.may_pass || surface.has_alpha || vertex.in_subsurface) return 0;
  if (!MayMerge<C::kTraits>(vertex.bsdf)) return 0;
  // The footprint at the same distance along the camera ray: mirrors and flat glass keep it.
  Ray camera_ray = path.ray;
  camera_ray.o = path.camera_o;
  camera_ray.d = path.other_end.camera_d;
  const Vec3d at =
      ToDouble(camera_ray.o) + Normalize(ToDouble(camera_ray.d)) * path.other_end.length;
  return MergeRadius(c.scene.camera.PdfWe(camera_ray, ToFloat(at)));
}

// The path arrives at the surface. Where it is the first rough one behind specular ones, light
// paths are merged there.
template <typename C, typename Vertex>
void FollowPrefix(const Context<C>& c, const Vertex& vertex, PathState<C>* path) {
  if constexpr (C::kPathKind == PathKind::kCameraBesideLight) {
    CameraEnd& end = path->other_end;
    if (!end.is_in_prefix) return;
    const bool is_first = end.length == 0;
    const Vec3f from = is_first ? path->camera_o : path->from;
    end.length += Length(ToDouble(vertex.point.p) - ToDouble(from));
    if (!vertex.SamplesLights(*path)) return;
    end.is_in_prefix = false;
    if (is_first) return;
    end.merge_radius = MergeRadiusAt(c, vertex, *path);
    const float cosine = std::fabs(Dot(Normalize(path->ray.d), vertex.point.ng));
    end.light_paths.Start(MergedLightPaths(c, end.merge_radius) * static_cast<double>(cosine));
    end.is_first = true;
  }
}
// The same at a vertex in a medium, where light paths are not merged.
template <typename C>
void LeavePrefix(PathState<C>* path) {
  if constexpr (C::kPathKind == PathKind::kCameraBesideLight) path->other_end.is_in_prefix = false;
}

// The vertex scatters the path towards wi with the pdf. eta_scale: BsdfSample::eta_scale.
template <typename C, typename Vertex>
void NoteScattering(const Context<C>& c, const Vertex& vertex, Vec3f wi, float pdf, uint8_t flags,
                    float eta_scale, PathState<C>* path) {
  if constexpr (C::kPathKind == PathKind::kCameraBesideLight) {
    CameraEnd& end = path->other_end;
    if (!end.light_paths.IsFound()) return;
    const auto cosines = static_cast<double>(vertex.FluxFactor(wi, *path));
    if ((flags & kBsdfSpecular) != 0) {
      // A light path cannot be connected to the lens here, or leaves otherwise.
      if (end.is_first || !vertex.IsReversible(c, wi, flags)) end.light_paths.Stop();
      end.light_paths.Add(SpecularStep(static_cast<double>(vertex.ScatteringShare()),
                                       static_cast<double>(eta_scale),
                                       static_cast<double>(vertex.ShadingCosines(wi)), cosines));
    } else {
      StepDensities step{.forward = static_cast<double>(pdf), .cosines = cosines};
      if (!end.is_first) {
        step.backward =
            static_cast<double>(vertex.SeenFrom(c, wi).EvalScattering(-path->ray.d).pdf);
      }
      end.light_paths.Add(step);
    }
    end.is_first = false;
  }
}

// A texture gives a walk beneath a surface its color where the walk begins, so that it is not the
// same walk in reverse: light paths end there, and do not find such paths. False where the path
// ends.
template <typename C>
bool EnterTexturedSubsurface(PathState<C>* path) {
  if (!path->media.properties.is_subsurface || path->media.subsurface_texture.OrNull() == nullptr) {
    return true;
  }
  if constexpr (C::kFromLight) return false;
  if constexpr (!C::kFromLight) path->other_end.light_paths.Stop();
  return true;
}

// The weight of a camera path's technique. others, light_paths: their densities over that of the
// technique.
template <typename C>
float WeightBesideLight(const Context<C>& c, std::array<double, 2> others, double light_paths) {
  if (c.scene.light_paths_alone && light_paths > 0) return 0;
  return static_cast<float>(WeightOf(1.0, others[0], light_paths, others[1]));
}

// The weight of light that the path's ray hits. sampled: the pdf with which the last vertex samples
// it; emitted: its density E. line: LineOverSample, here and below; 0 where no line leads there.
template <typename C>
float HitWeight(const Context<C>& c, double sampled, double emitted, const PathState<C>& path,
                double line = 0) {
  const double other = path.specular ? 0 : sampled / static_cast<double>(path.pdf);
  return WeightBesideLight(c, {other, line > 0 ? other * line : 0},
                           path.other_end.light_paths.ratio() * emitted);
}

// The density of light paths over that with which the vertex samples their light, in direction wi.
template <typename C, typename Vertex>
double LightPathsOverSample(const Context<C>& c, const Vertex& vertex, Vec3f wi, double emitted,
                            double sampled, const PathState<C>& path) {
  StepDensities step{.forward = sampled,
                     .cosines = static_cast<double>(vertex.FluxFactor(wi, path))};
  if (!path.other_end.is_first) {
    step.backward = static_cast<double>(vertex.SeenFrom(c, wi).EvalScattering(-path.ray.d).pdf);
  }
  return path.other_end.light_paths.ratio() * emitted * step.LightOverCamera();
}

// The weight of a light sample at the vertex, towards which it scatters with the pdf.
template <typename C, typename Vertex>
float LightSampleWeightBesideLight(const Context<C>& c, const Vertex& vertex,
                                   const LightSampleOf<typename C::Color>& light, float pdf,
                                   const PathState<C>& path, double line = 0) {
  const double sampled = static_cast<double>(light.pdf);
  const double other = light.is_delta ? 0 : static_cast<double>(pdf) / sampled;
  if (!path.other_end.light_paths.IsFound()) return WeightBesideLight(c, {other, line}, 0);
  const GuidedEmission& emission = c.emission;
  const double emitted = light.is_infinite && !light.is_delta
                             ? emission.InfiniteDensityAt(vertex.point.p, -light.wi)
                             : emission.DensityAt(light.light, vertex.point.p, light.p_light,
                                                  light.n_light, -light.wi);
  return WeightBesideLight(c, {other, line},
                           LightPathsOverSample(c, vertex, light.wi, emitted, sampled, path));
}

// The weight of emission of media along w, a direction that the vertex samples by it with density
// `sampled`, and towards which it scatters with the pdf.
template <typename C, typename Vertex>
float MediaSampleWeightBesideLight(const Context<C>& c, const Vertex& vertex, Vec3f w,
                                   double sampled, float pdf, const PathState<C>& path) {
  const double other = static_cast<double>(pdf) / sampled;
  if (!path.other_end.light_paths.IsFound()) return WeightBesideLight(c, {other, 0}, 0);
  const double emitted = MediaDensityAt(c, vertex.point.p, w);
  return WeightBesideLight(c, {other, 0},
                           LightPathsOverSample(c, vertex, w, emitted, sampled, path));
}

// --- Paths from a light --------------------------------------------------------------------------

// The density with which the path's first vertex samples its light, in direction w. query: of one
// sample, or of parts.
template <typename C, typename Vertex>
double SampledAtFirst(const Context<C>& c, const Vertex& vertex, Vec3f w, const LightEnd& end,
                      const LightQuery& query) {
  const auto& lights = *c.scene.lights;
  const Vec3f p = vertex.point.p, n = vertex.light_hint;
  if (end.is_infinite) {
    return static_cast<double>(lights.template PdfEnvironment<C::kTraits>(p, n, w, query));
  }
  if (c.emission.lights().IsSurface(end.light)) {
    return static_cast<double>(
        lights.template PdfEmitter<C::kTraits>(end.light, p, n, w, end.p, query));
  }
  if constexpr (C::kCountsSplits) {
    if (query.samples_max > 1) {
      return static_cast<double>(
          lights.choice().Probability(end.light, p, n, QueryFor<C::kTraits>(query)));
    }
  }
  return static_cast<double>(lights.ChoiceProbability(end.light, p, n, query.row));
}

// The same for each number of samples that the vertex, of a surface, may take.
template <typename C, typename Vertex>
void FindParts(const Context<C>& c, const Vertex& vertex, Vec3f w, LightEnd* end) {
  if (!c.scene.lights->choice().splits()) return;
  SampledByParts& parts = end->by_parts;
  for (; parts.count < kLightHalvingsMax; ++parts.count) {
    const uint32_t samples = LightSamplesAt(c.scene.settings.light_samples, parts.count);
    if (samples == 1) break;
    parts.density[parts.count] =
        SampledAtFirst(c, vertex, w, *end, {vertex.guided.lights(), samples});
  }
  end->is_open = parts.count > 0;
}

// At the path's first vertex: the densities that depend on it. False where the light does not reach
// it.
template <typename C, typename Vertex>
bool ArriveFirst(const Context<C>& c, const Vertex& vertex, bool samples_lights,
                 PathState<C>* path) {
  LightEnd& end = path->other_end;
  const GuidedEmission& emission = c.emission;
  const Vec3f p = vertex.point.p, w = Normalize(path->ray.d);
  if (end.is_medium) {
    end.emitted = MediaDensityAt(c, p, -w);
  } else if (end.is_infinite) {
    if (!(emission.PdfLe(end.light, p, {}, {}, w) > 0)) return false;
    end.emitted = emission.InfiniteDensityAt(p, w);
  } else {
    end.emitted = emission.DensityAt(end.light, p, end.p, end.n, w);
  }
  if (!(end.emitted > 0)) return false;
  end.camera_paths.Start(1 / end.emitted);
  if (!samples_lights) return true;
  if (end.is_medium) {
    end.sampled = MediaPdf(c, p, -w);
    return true;
  }
  end.sampled = SampledAtFirst(c, vertex, -w, end, vertex.guided.lights());
  if constexpr (C::kCountsSplits && Vertex::kIsSurface) FindParts(c, vertex, -w, &end);
  return true;
}

// The density with which the camera's techniques together pass the path's first vertex, where
// scattering has density `hit`. line: LineOverSample. vertices: of the whole path, without its
// ends.
inline double CameraPathsAtFirst(const LightEnd& end, double hit, double line, uint32_t vertices) {
  const SampledByParts& parts = end.by_parts;
  const double sampled = vertices - 1 < parts.count ? parts.density[vertices - 1] : end.sampled;
  return line > 0 ? std::hypot(hit, sampled, sampled * line) : std::hypot(hit, sampled);
}

// A vertex scatters a path from a light, and a path from the camera as the step says.
inline void NoteScatteringFromLight(StepDensities step, bool is_specular, LightEnd* end) {
  if (end->is_first) {
    const double hit = end->can_be_hit ? step.forward : 0;
    end->is_open = end->is_open && !is_specular;
    end->hit = hit;
    step.forward = end->is_open ? 1 : is_specular ? hit : std::hypot(hit, end->sampled);
  }
  end->camera_paths.Add(step);
  end->is_first = false;
  end->is_scattered = end->is_scattered || !is_specular;
  if (!end->is_scattered) ++end->interfaces;
}

// Those of a path that chains may find; 0: they do not.
inline uint32_t InterfacesOfChain(const LightEnd& end) {
  const bool is_area = end.can_be_hit && !end.is_infinite && !end.is_medium;
  return is_area ? end.interfaces : 0;
}

// A camera path comes to the first vertex out of a walk beneath its surface, and takes one light
// sample.
inline void LeaveBySubsurface(LightEnd* end) { end->by_parts.count = 0; }

// The density of the camera's techniques over that of light paths at the path's last vertex, where
// scattering has density `forward`; of the way from the camera to that vertex both are left out.
// line, vertices: as for CameraPathsAtFirst; the line is that from the camera.
inline double CameraPathsTo(const LightEnd& end, double forward, double line, uint32_t vertices) {
  const double ratio = end.camera_paths.ratio();
  if (end.is_first) {
    return ratio * CameraPathsAtFirst(end, end.can_be_hit ? forward : 0, line, vertices);
  }
  if (!end.is_open) return ratio * forward;
  return ratio * CameraPathsAtFirst(end, end.hit, end.line.over_sample, vertices) * forward;
}

// The density of the camera's techniques over that of light paths at a connection to the lens.
// forward: that of scattering; flux: of the vertex, towards the lens. seen: as
// CameraConnection::ray_density.
template <typename C>
double CameraPathsAtLens(const Context<C>& c, double forward, double flux, double seen,
                         const PathState<C>& path, double line = 0) {
  return CameraPathsTo(path.other_end, forward, line, path.depth) * flux * seen /
         c.scene.light_paths_per_pass;
}

// The same for a light path that is merged, within the radius and at the cosine, with a camera path
// of camera_vertices vertices.
template <typename C>
double CameraPathsAtMerge(const Context<C>& c, double forward, float radius, double cosine,
                          uint32_t camera_vertices, const PathState<C>& path) {
  // Both count the vertex.
  const uint32_t vertices = camera_vertices + path.depth - 1;
  return CameraPathsTo(path.other_end, forward, 0, vertices) /
         (MergedLightPaths(c, radius) * cosine);
}

// The weight of that connection, or of the merge.
template <typename C>
float ConnectionWeight(const Context<C>& c, double camera_paths) {
  return c.scene.light_paths_alone ? 1 : static_cast<float>(WeightOf(1.0, camera_paths));
}

// The kind of light that the vertex, the last one, scatters to the camera.
template <typename C, typename Vertex>
LightPathKind KindFromLight(const Vertex& vertex, const PathState<C>& path) {
  if (path.other_end.is_medium) return LightPathKind::kVolumeEmission;
  auto history = path.history;
  vertex.AddTo(&history);
  return history.KindFromLight(path.other_end.is_specular_first);
}

}  // namespace sheaf::render
