// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Context: what every component of the integrator works with while it traces one sample.
#pragma once

#include "common/film/film_tile.h"
#include "worker/render/guiding/guided_emission.h"
#include "worker/render/guiding/learned_fields.h"
#include "worker/render/integrator/light_groups.h"
#include "worker/render/integrator/path_state.h"
#include "worker/render/integrator/ray_counts.h"
#include "worker/render/integrator/training_records.h"
#include "worker/render/sampling/dimensions.h"
#include "worker/render/sampling/sampler.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {

template <typename C>
class SplitPaths;

// The knowledge that the paths of a frame with learned fields use, and the records that they fill.
template <typename C>
struct Guiding {
  const LearnedFields* fields = nullptr;
  TrainingRecords<C>* training = nullptr;  // Null unless the path is one of a training.
  SplitPaths<C>* splits = nullptr;         // Null unless paths are split.
};

// All referents outlive it. Not thread-safe: each thread has its own.
template <typename C>
struct Context {
  const CompiledScene& scene;
  typename C::Tracer& tracer;
  const typename C::Sampler& sampler;
  RayCounts& counts;
  OutputSample* outputs;  // Null if the settings request none.
  LightGroups<typename C::Color>& groups;
  [[no_unique_address]] StateIf<C::kKnowsLights, Guiding<C>> guiding;
  // How light paths begin, and the densities of that.
  [[no_unique_address]] StateIf<C::kBothEnds, GuidedEmission> emission;
};

// The emission of the scene in frames with light paths, by what has been learned. fields: may be
// null.
template <typename C>
auto EmissionBy([[maybe_unused]] const CompiledScene& scene,
                [[maybe_unused]] const LearnedFields* fields) {
  StateIf<C::kBothEnds, GuidedEmission> emission;
  if constexpr (C::kBothEnds) {
    emission = {scene.emission.get(), fields == nullptr ? nullptr : &fields->emission};
  }
  return emission;
}

// Adds radiance that arrived from one light to the path, and to the light's group.
template <typename C>
void AddLight(const Context<C>& c, uint32_t light, LightPathKind kind,
              const typename C::Color& radiance, PathState<C>* path) {
  path->radiance += radiance;
  if constexpr (C::kOutputs) c.groups.Add(*c.scene.lights, light, kind, radiance);
}
// The same for `radiance`, weight times the radiance of all infinite lights that arrives at p from
// direction d.
template <typename C>
void AddInfiniteLight(const Context<C>& c, Vec3f p, Vec3f d, const typename C::Color& weight,
                      LightPathKind kind, const typename C::Color& radiance, PathState<C>* path) {
  path->radiance += radiance;
  if constexpr (C::kOutputs) {
    c.groups.AddSky(*c.scene.lights, p, d, path->wavelengths, weight, kind, radiance);
  }
}
// The same for the emission of media.
template <typename C>
void AddVolumeEmission(const Context<C>& c, const typename C::Color& radiance, PathState<C>* path) {
  path->radiance += radiance;
  if constexpr (C::kOutputs) c.groups.AddMediumEmission(c.scene.media_group, radiance);
}

// Refraction leads each wavelength elsewhere: the path continues with the primary one, which takes
// the weight of all. Source: Wilkie et al. 2014.
template <typename C>
void TerminateSecondaryWavelengths(PathState<C>* path) {
  if (path->secondary_terminated) return;
  path->secondary_terminated = true;
  path->throughput = {{path->throughput[0] * kWavelengthCount}};
}

// Counts a vertex. in_subsurface: of a walk, or a boundary met from inside. False where the path
// ends.
template <typename C>
bool CountVertex(const Context<C>& c, bool in_subsurface, PathState<C>* path) {
  if constexpr (C::kSubsurface) {
    path->subsurface.vertex = NextVertexIndex(*path);
    if (path->media.properties.is_subsurface && ++path->subsurface.steps > kSubsurfaceStepsMax) {
      ++c.counts.long_walks;
      return false;
    }
    if (in_subsurface) return true;
  }
  return path->depth++ != static_cast<uint32_t>(c.scene.settings.max_depth);
}

// --- Frames with chains. worker/render/chains defines these functions, and the variants of such
// --- frames alone include it.

// Adds the light of a lamp that reaches the vertex through smooth interfaces, and that the vertex
// scatters back along the path. Vertex: SurfaceVertex.
template <typename C, typename Vertex>
void SampleChain(const Context<C>& c, const Vertex& vertex, PathState<C>* path);
// Whether SampleChain finds the emission that the path's ray hits. A function of the path alone.
template <typename C>
bool IsFoundByChain(const Context<C>& c, uint32_t emitter, const PathState<C>& path);
// The vertex scatters the path. flags: of the BSDF's sample.
template <typename C, typename Vertex>
void NoteChainScattering(const Context<C>& c, const Vertex& vertex, uint8_t flags,
                         PathState<C>* path);

}  // namespace sheaf::render
