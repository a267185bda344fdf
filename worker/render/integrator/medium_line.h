// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LineOf: the line of a segment in scattering media, along which equiangular_sampling.h samples
// light, and the density of that.
//
// Beside light paths, weights are functions of what both ends of a path know (two_ends.h): where
// the camera's segment begins, but neither where it ends nor the throughput there. So weights are
// those of a line without end and of a gray throughput. Distances are sampled on the true segment,
// whose density is a little larger. Which light a line samples, and whether lines through
// heterogeneous media sample any, is decided by the line without end, so that weights are 0 where
// lines find nothing. Source: docs/adr/0132-lines-and-splits-beside-light-paths.md.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include "worker/render/integrator/guided_directions.h"
#include "worker/render/integrator/heterogeneous_transport.h"
#include "worker/render/integrator/two_ends.h"
#include "worker/render/medium/equiangular_segment.h"

namespace sheaf::render {

template <typename C>
using LineOf = EquiangularSegment<typename C::Color>;

template <typename C>
bool UsesLineSampling(const MediumProperties<typename C::Color>& properties) {
  return (properties.scatters || (C::kHeterogeneousLines && properties.gathers)) &&
         !properties.is_subsurface;
}

// The distance from o along d at which a line leaves the scene's bounds; infinite where it does
// not.
inline double DistanceInScene(const SceneGeometry& geometry, Vec3d o, Vec3d d) {
  double nearest = std::numeric_limits<double>::infinity();
  for (size_t a = 0; a < 3; ++a) {
    if (d[a] == 0) continue;
    const Vec3f& end = d[a] > 0 ? geometry.bounds_upper : geometry.bounds_lower;
    nearest = std::min(nearest, (static_cast<double>(end[a]) - o[a]) / d[a]);
  }
  return nearest > 0 ? nearest : std::numeric_limits<double>::infinity();
}

// The line from o along d, unit, through the media, up to `length`.
template <typename C>
LineOf<C> LineAlong(const Context<C>& c, Vec3d o, Vec3d d, const MediumState<C>& media,
                    double length) {
  using Color = typename C::Color;
  LineOf<C> line;
  line.o = o;
  line.d = d;
  line.length = length;
  const MediumProperties<Color>& properties = media.properties;
  double sigma_t = 0;
  for (size_t i = 0; i < kComponentCount<Color>; ++i) {
    sigma_t += static_cast<double>(properties.sigma_t[i]) / kComponentCount<Color>;
  }
  if constexpr (C::kHeterogeneousLines) {
    if (properties.gathers) {
      const auto part = c.scene.media->EquiangularSpanOf(media.set, line.o, line.d, length);
      sigma_t += part.extinction;
      if (!properties.scatters) {
        line.begin = part.begin;
        line.length = part.end;
        line.extinction = c.scene.media->gathers_always() ? 0 : part.extinction;
      }
    }
  }
  double end = line.length;
  if constexpr (C::kBothEnds) end = std::min(end, DistanceInScene(c.scene.geometry, o, d));
  double middle = 0.5 * std::min(end - line.begin, 2 / sigma_t);
  if constexpr (C::kHeterogeneousLines) middle += line.begin;
  line.choice_point = ToFloat(line.o + middle * line.d);
  return line;
}

// The line of the path's ray, up to `length`; beside light paths, without end.
template <typename C>
LineOf<C> MakeLine(const Context<C>& c, const PathState<C>& path, double length) {
  if constexpr (C::kBothEnds) length = std::numeric_limits<double>::infinity();
  LineOf<C> line =
      LineAlong(c, ToDouble(path.ray.o), Normalize(ToDouble(path.ray.d)), path.media, length);
  line.carried = path.throughput;
  return line;
}

// The throughput at the start of the line that densities of distances go by.
template <typename C>
typename C::Color CarriedOf(const LineOf<C>& line) {
  if constexpr (C::kBothEnds) return C::Color::Gray(1);
  return line.carried;
}

// The density of distances on the line for the light; none where line sampling does not pay off.
template <typename C>
std::optional<EquiangularDistances> DistancesOn(const Context<C>& c, const LineOf<C>& line,
                                                uint32_t light) {
  const LightBounds bounds = c.scene.lights->BoundsOf(light);
  if constexpr (C::kHeterogeneousLines) {
    if (line.extinction > 0 && bounds.kind != LightBounds::Kind::kInfinite &&
        !(DistanceSamplingSpread(bounds, line.o, line.d, line.begin, line.length,
                                 line.extinction) >= kSpreadGathered)) {
      return std::nullopt;
    }
    return DistancesTo(bounds, line.o, line.d, line.begin, line.length);
  } else {
    return DistancesTo(bounds, line.o, line.d, 0, line.length);
  }
}

// The density of FindsBy::kLine for p, at t, and a point of the light that light sampling from p
// finds with light_pdf. known: what is known of the lights at p.
template <typename C>
double LineTechniquePdf(const Context<C>& c, const LineOf<C>& line, uint32_t light, Vec3f p,
                        LightVisibilityRow known, double t, float light_pdf) {
  const auto distances = DistancesOn(c, line, light);
  if (!distances) return 0;
  const float chosen_there = c.scene.lights->ChoiceProbability(light, p, {}, known);
  if (!(chosen_there > 0)) return 0;
  const float chosen_for_line = c.scene.lights->ChoiceProbability(light, line.choice_point);
  return static_cast<double>(light_pdf) / static_cast<double>(chosen_there) *
         static_cast<double>(chosen_for_line) * distances->Pdf(t);
}

// --- Beside light paths --------------------------------------------------------------------------

// The density with which a line samples the light and the place p of the path's last vertex, over
// that with which the vertex, to which the line leads, samples the light; 0 where lines do not find
// it. known: what is known of the lights at p.
template <typename C>
double LineOverSample([[maybe_unused]] const Context<C>& c,
                      [[maybe_unused]] const PathState<C>& path, [[maybe_unused]] uint32_t light,
                      [[maybe_unused]] Vec3f p, [[maybe_unused]] LightVisibilityRow known) {
  if constexpr (C::kLines) {
    const LineOf<C>& line = path.media.line;
    if (!line.has_scattered || !(line.density > 0)) return 0;
    return LineTechniquePdf(c, line, light, p, known, line.t, 1) / line.density;
  }
  return 0;
}

// The density of light paths over that with which a vertex at p, where the line scatters the path,
// samples the light. phase_pdf: of scattering towards the light.
template <typename C>
double LightPathsOverSampleOnLine(const Context<C>& c, Vec3f p,
                                  const LightSampleOf<typename C::Color>& light, float phase_pdf,
                                  const PathState<C>& path) {
  const CameraEnd end = EndAt(c, p, path);
  if (!end.light_paths.IsFound()) return 0;
  const StepDensities step{.forward = static_cast<double>(light.pdf),
                           .backward = end.is_first ? 1 : static_cast<double>(phase_pdf)};
  return end.light_paths.ratio() *
         c.emission.DensityAt(light.light, p, light.p_light, light.n_light, -light.wi) *
         step.LightOverCamera();
}

// The light path's first vertex, in a medium: notes what the density of the camera's line needs.
template <typename C, typename Vertex>
void SeekLine([[maybe_unused]] const Context<C>& c, [[maybe_unused]] const Vertex& vertex,
              [[maybe_unused]] PathState<C>* path) {
  if constexpr (C::kCountsLines && !Vertex::kIsSurface) {
    LightEnd& end = path->other_end;
    const MediumProperties<typename C::Color>& properties = path->media.properties;
    if (end.is_medium || end.is_infinite || !UsesLineSampling<C>(properties)) return;
    if (c.scene.lights->BoundsOf(end.light).kind == LightBounds::Kind::kInfinite) return;
    KnownLine& line = end.line;
    const Vec3f p = vertex.point.p;
    if (vertex.scatterer) {
      if (!C::kHeterogeneousLines || !c.scene.media->Gathers(*vertex.scatterer)) return;
      const auto its = c.scene.media->template CoefficientsAt<typename C::Color>(
          *vertex.scatterer, ToDouble(p), TimeOfMedia<C::kTraits>(path->ray.time),
          path->wavelengths, properties.form);
      line.extinction = MeanExtinction<C::kChromaticMedia>(its.sigma_t, C::Color::Gray(1));
      if (!(line.extinction > 0)) return;
    }
    line.chosen = static_cast<double>(
        c.scene.lights->ChoiceProbability(end.light, p, {}, vertex.guided.lights()));
    line.is_sought = end.is_open = line.chosen > 0;
  }
}

// LineOverSample of the line from o to p, the first vertex of a light path.
template <typename C>
double LineOverSampleFrom(const Context<C>& c, Vec3d o, Vec3f p, const PathState<C>& path) {
  const LightEnd& end = path.other_end;
  const Vec3d way = ToDouble(p) - o;
  const double t = Length(way);
  const LineOf<C> line =
      LineAlong(c, o, Normalize(way), path.media, std::numeric_limits<double>::infinity());
  const double density = end.line.extinction > 0 ? end.line.extinction
                                                 : DistancePdf<C::kChromaticMedia>(
                                                       path.media.properties, t, C::Color::Gray(1));
  const auto distances = DistancesOn(c, line, end.light);
  if (!distances || !(density > 0)) return 0;
  const float chosen_for_line = c.scene.lights->ChoiceProbability(end.light, line.choice_point);
  return 1 / end.line.chosen * static_cast<double>(chosen_for_line) * distances->Pdf(t) / density;
}

// The light path meets a surface or scatters at p. If that is where the camera's segment to its
// first vertex begins, finds the density of the segment's line. Call before the path's media
// change.
template <typename C>
void MeetLine([[maybe_unused]] const Context<C>& c, [[maybe_unused]] Vec3f p,
              [[maybe_unused]] PathState<C>* path) {
  if constexpr (C::kCountsLines) {
    KnownLine& line = path->other_end.line;
    if (!line.is_sought) return;
    line.over_sample = LineOverSampleFrom(c, ToDouble(p), path->from, *path);
    line.is_sought = false;
  }
}

}  // namespace sheaf::render
