// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathState: a path between two vertices, as plain data. Members of effects that a configuration
// does not have take no memory.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "common/math/vec.h"
#include "common/scene/ray_kinds.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/densities/running_density.h"
#include "worker/render/geometry/crossing.h"
#include "worker/render/geometry/ray_origin.h"
#include "worker/render/integrator/integrator_config.h"
#include "worker/render/integrator/path_history.h"
#include "worker/render/light/choice/light_visibility_row.h"
#include "worker/render/light/choice/lobe_sketch.h"
#include "worker/render/light/environment_map.h"
#include "worker/render/material/subsurface_texture.h"
#include "worker/render/medium/equiangular_segment.h"
#include "worker/render/medium/medium.h"
#include "worker/render/medium/medium_set.h"
#include "worker/render/sampling/dimensions.h"

namespace sheaf::render {

// Vertices from this number on take one light sample: the limit halves at each (light_splits.h).
inline constexpr uint32_t kLightHalvingsMax = std::bit_width(uint32_t{kLightSamplesMax}) - 1;

struct NoState {};
template <bool kPresent, typename State>
using StateIf = std::conditional_t<kPresent, State, NoState>;

// The tangent plane of a surface so near to a path in a medium that rounding could move the path to
// the other side. Space: render.
struct NearPlane {
  Vec3f p, n;  // n: unit, on the side of the path.
  bool is_set = false;
  float p_error = 0;  // Bound of the error of p along n; for subsurface media only.
  // The exact position of the path minus p, if known; the position itself is rounded.
  Vec3d offset{};
  bool has_offset = false;
};

// The media that a path is in, and their effect on light.
template <typename C>
struct MediumState {
  using Color = typename C::Color;
  // Ranks of the interiors with a priority that contain the path. The medium of the highest is in
  // `set`.
  [[no_unique_address]] StateIf<C::kNested, MediumSet> interiors;
  MediumSet set;
  MediumProperties<Color> properties;
  uint32_t scatterings = 0;  // Number so far.
  NearPlane near;
  Crossing last;  // The last boundary crossed.
  // The segment that led to the path's last vertex.
  [[no_unique_address]] StateIf<C::kLines, EquiangularSegment<Color>> line;
  [[no_unique_address]] SubsurfaceTexture<Color, C::kTexturedSubsurface> subsurface_texture;
};

// A walk in a subsurface medium: subsurface_walk.h.
struct SubsurfaceState {
  uint32_t steps = 0;   // Number of vertices so far.
  uint32_t vertex = 0;  // The last vertex, for its sample dimensions.
  // The exact position minus the rounded one, or minus near.p if the walk is next to that plane.
  Vec3d offset{};
  bool is_near = false;      // The walk continues in front of a plane, without rays.
  bool has_arrived = false;  // The ray leads to the boundary, which the path meets along:
  Vec3f arrives_along;
};

// Densities with which the other end finds the path so far, each over that of scattering, by which
// the path itself continues: two_ends.h. Vertices that do not belong to the path yet have no part
// in them.
struct CameraEnd {
  RunningDensity<PathEnd::kCamera> light_paths;
  bool is_first = true;  // No vertex has scattered the path yet that light paths may meet.
  // In frames that merge: all vertices so far are specular. Then the length of the path, and the
  // direction of the camera ray.
  bool is_in_prefix = false;
  double length = 0;
  Vec3f camera_d{};
  float merge_radius = 0;  // MergeRadius at the vertex where light paths meet it by merging.
};
// Where the first vertex splits the lights, as vertex i of the camera's path: the densities with
// which it samples the light; by i, up to the last that takes several samples.
struct SampledByParts {
  std::array<double, kLightHalvingsMax> density{};
  uint32_t count = 0;
};
// The line of the camera's path that leads to the first vertex.
struct KnownLine {
  // The vertex scatters paths on it, and the path has not met its start yet.
  bool is_sought = false;
  double chosen = 0;       // The probability with which the vertex chooses the light.
  double extinction = 0;   // The heterogeneous medium that scatters; 0: homogeneous ones do.
  double over_sample = 0;  // The density of line samples over that of light samples.
};
struct LightEnd {
  uint32_t light = 0;
  Vec3f p, n;                // The ray that left the light, as in EmittedRay.
  bool is_infinite = false;  // Not a distant light.
  bool is_medium = false;    // The emission of media; `light` and `n` are unused.
  bool can_be_hit = false;   // Scattering finds the light.
  double scale = 0;          // Flux is throughput * scale.
  // With which the light emits the path, and with which the first vertex samples the light.
  double emitted = 0, sampled = 0;
  RunningDensity<PathEnd::kLight> camera_paths;  // The camera's techniques together.
  bool is_first = true, is_specular_first = false;
  // Specular vertices before the first other one: with an area light, chains may find the path.
  uint32_t interfaces = 0;
  bool is_scattered = false;  // By a vertex that is not specular.
  // The densities of the camera's techniques at the first vertex depend on the vertices after it,
  // and are no part of camera_paths.
  bool is_open = false;
  double hit = 0;  // The density of scattering there.
  SampledByParts by_parts;
  KnownLine line;
};

// The state of paths in frames whose lights are learned.
struct KnownLightsState {
  LightVisibilityRow lights;  // The row of the region of `from`.
};

// The part of a path that tells which light chains find: IsFoundByChain.
struct ChainState {
  // Every vertex since the last rough one, which is on a surface, is an interface of a chain.
  bool is_open = false;
  uint8_t interfaces = 0;  // Their number.
  // A vertex was not specular.
  bool is_scattered = false;

  // Chains do not find what the path's ray hits.
  void Close() {
    is_open = false;
    interfaces = 0;
  }
};

// The state of paths in guided frames.
template <typename Color>
struct GuidedState {
  Color throughput_before;  // Before the last vertex scattered the path.
  // The light that paths bring through the last vertex, as they carry it to the camera: what its
  // region scatters, over the same of the first vertex; 0: unknown.
  float expected_light = 0;
  float first_light = 0;      // The expected light of the first vertex.
  float scattering_part = 1;  // As a part of the density of the path's direction: FoundLight.
};

// The state of paths in frames that split the lights.
struct LightSplitState {
  uint32_t samples_max = 1;  // LightQuery::samples_max at `from`.
};

// The state of paths whose rays are of kinds.
struct RayState {
  RayKind kind = RayKind::kCamera;
  bool has_searched = false;  // The lights that the ray hits are counted: SearchLights.
  bool searches = false;      // The path looks for lights alone, as shadow rays see them.
};

// One path. It may begin at the camera, at a light, or in space: the state names only the next ray
// and how its direction was sampled.
template <typename C>
struct PathState {
  using Color = typename C::Color;
  Ray ray;  // The next segment.
  [[no_unique_address]] typename C::Wavelengths wavelengths;
  Color throughput = Color::Gray(1);
  Color radiance;
  // Russian roulette ignores radiance gained by refraction into denser media, and weight lost
  // to directions that the field sampled more often than the BSDF would, and to splitting.
  float roulette_scale = 1;
  uint32_t depth = 0;                 // Number of scattering events so far.
  bool secondary_terminated = false;  // Spectral: the path carries the primary wavelength alone.
  bool specular = true;               // Light sampling cannot find what the ray hits.
  float pdf = 0;       // Density of the direction, per solid angle; unused if specular.
  Vec3f from, from_n;  // The last vertex, and its normal for light sampling.
  // Where the direction points, after the first scattering on a surface or in homogeneous media.
  EnvironmentMap::Place sky_place;
  [[no_unique_address]] StateIf<C::kMedia, MediumState<C>> media;
  [[no_unique_address]] StateIf<C::kSubsurface, SubsurfaceState> subsurface;
  [[no_unique_address]] std::conditional_t<C::kOutputs, PathHistory, NoHistory> history;
  [[no_unique_address]] StateIf<C::kBothEnds,
                                std::conditional_t<C::kFromLight, LightEnd, CameraEnd>>
      other_end;
  [[no_unique_address]] StateIf<C::kKnowsLights, KnownLightsState> known;
  [[no_unique_address]] StateIf<C::kGuided, GuidedState<Color>> guided;
  [[no_unique_address]] StateIf<C::kSplitsLights, LightSplitState> splits;
  [[no_unique_address]] StateIf<C::kProduct, LobeSketch> sketch;  // The vertex's at `from`.
  [[no_unique_address]] StateIf<C::kRayKinds, RayState> rays;
  [[no_unique_address]] StateIf<C::kChains, ChainState> chain;
  Vec3f camera_o;               // The origin of the camera ray.
  bool is_camera_path = true;   // No vertex so far.
  uint32_t null_crossings = 0;  // Surfaces passed since the last vertex.
};

// The vertex whose sample dimensions the next decision draws from, and the last vertex.
template <typename C>
uint32_t NextVertexIndex(const PathState<C>& path) {
  if constexpr (C::kSubsurface) {
    return path.media.properties.is_subsurface ? kSubsurfaceVertex + path.subsurface.steps
                                               : path.depth;
  }
  return path.depth;
}
template <typename C>
uint32_t LastVertexIndex(const PathState<C>& path) {
  if constexpr (C::kSubsurface) return path.subsurface.vertex;
  return path.depth - 1;
}

}  // namespace sheaf::render
