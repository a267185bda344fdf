// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Variant: the compiled variants of the path tracer, and the choice among them.
#pragma once

#include <cstdint>

#include "common/film/film_tile.h"
#include "common/film/tile_geometry.h"
#include "worker/render/integrator/path_integrator.h"
#include "worker/render/integrator/splat_sink.h"
#include "worker/render/integrator/training_pass.h"
#include "worker/render/traits/variant_choice.h"

namespace sheaf::render {

class EmissionStatistics;
struct GatherMap;

// Renders the block of samples of pixels [x0, x1) of row y.
using RenderRowFunction = void (*)(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y,
                                   SampleBlock block, PixelAccumulator* accumulator,
                                   RayCounts* counts);
// variant: an index in AllVariants().
RenderRowFunction RowFunctionOf(size_t variant);

// --- Frames with light paths. variant: an index in AllLightPathVariants().

// As RowFunctionOf, for the camera's paths.
RenderRowFunction RowBesideLightOf(size_t variant);
// Adds to the map's arena the camera paths of pixels [x0, x1) of row y with which light paths of
// the pass are merged. Requires: scene.gather_step > 0; the map's sample and scale are of the pass.
using GatherRowFunction = void (*)(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y,
                                   uint64_t pass, GatherMap* map, RayCounts* counts);
GatherRowFunction GatherRowFunctionOf(size_t variant);
// Traces the light paths of the pass that are named after the pixels [x0, x1) of row y. map: what
// they are merged with; null where the scene does not merge.
using LightRowFunction = void (*)(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y,
                                  uint64_t pass, const GatherMap* map, SplatSink* splats,
                                  RayCounts* counts);
LightRowFunction LightRowFunctionOf(size_t variant);

// --- Training.

// Traces the paths [first, end) of the pass, guided by `fields`, and gives what they find to
// `sink`.
using TrainingFunction = void (*)(const CompiledScene& scene, const TrainingPass& pass,
                                  const LearnedFields& fields, uint64_t first, uint64_t end,
                                  GuidingSink* sink, RayCounts* counts);
// Requires: the variant, as of RowFunctionOf and RowBesideLightOf, has Trait::kGuiding.
TrainingFunction TrainingFunctionOf(size_t variant);
TrainingFunction TrainingBesideLightOf(size_t variant);

// Traces the light paths [first, end) of the pass, which begin by the emission of `fields`, and
// gives what they bring to the picture to `statistics`.
using LightTrainingFunction = void (*)(const CompiledScene& scene, const TrainingPass& pass,
                                       const LearnedFields& fields, uint64_t first, uint64_t end,
                                       EmissionStatistics* statistics, RayCounts* counts);
// variant: as of LightRowFunctionOf.
LightTrainingFunction LightTrainingFunctionOf(size_t variant);

// Defined once for each variant, in generated files.
template <TraitBits kTraits, PathKind kPathKind = PathKind::kCamera>
void RenderRow(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y, SampleBlock block,
               PixelAccumulator* accumulator, RayCounts* counts);
template <TraitBits kTraits>
void GatherRow(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y, uint64_t pass,
               GatherMap* map, RayCounts* counts);
template <TraitBits kTraits>
void TraceLightRow(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y, uint64_t pass,
                   const GatherMap* map, SplatSink* splats, RayCounts* counts);
template <TraitBits kTraits>
void TrainLightPaths(const CompiledScene& scene, const TrainingPass& pass,
                     const LearnedFields& fields, uint64_t first, uint64_t end,
                     EmissionStatistics* statistics, RayCounts* counts);
template <TraitBits kTraits, PathKind kPathKind = PathKind::kCamera>
void TrainPaths(const CompiledScene& scene, const TrainingPass& pass, const LearnedFields& fields,
                uint64_t first, uint64_t end, GuidingSink* sink, RayCounts* counts);

}  // namespace sheaf::render
