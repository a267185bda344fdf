// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Splitting: where a field knows that the light to be found matters to the pixel and is uncertain,
// several paths leave a vertex, each with its part of the weight
// (worker/render/guiding/contribution_field.h). Sources: Vorba and Krivanek 2016, "Adjoint-Driven
// Russian Roulette and Splitting in Light Transport Simulation"; Rath et al. 2022, "EARS:
// Efficiency-Aware Russian Roulette and Splitting". docs/adr/0091.
//
// The number of paths is rounded at random to a whole one, with its mean, after the limits below
// have bounded it, so the image keeps its mean. All paths of a sample add to one value, so that
// samples are as independent as before and error bars are true. Light is sampled at the vertex
// once. The weights of multiple importance sampling stay those of a single path: they sum to 1
// whatever the number.
//
// Paths that wait for the one before them are on a stack: there is no recursion. Each has a sampler
// of its own, named by its number within the sample, so that no other path's numbers change.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "worker/render/integrator/context.h"

namespace sheaf::render {

// Paths that leave a vertex.
inline constexpr float kSplitNumberMax = 8;
// Paths that wait at once, and that split off in all, of one sample.
inline constexpr uint32_t kSplitPathsWaitingMax = 64, kSplitPathsOfSampleMax = 256;

// The paths of one sample that split off. Not thread-safe.
template <typename C>
class SplitPaths {
 public:
  struct Waiting {
    PathState<C> path;
    uint32_t number = 0;                               // Within the sample, from 1.
    size_t record = TrainingRecords<C>::kNotRecorded;  // The record of the direction that it took.
  };

  // A sample's first path begins. The sampler outlives all its paths. pixel_factor:
  // ContributionField::PixelFactor.
  void Begin(const Sampler& sampler, float pixel_factor) {
    sampler_ = &sampler;
    pixel_factor_ = pixel_factor;
    count_ = 0;
    waiting_.clear();
  }
  float pixel_factor() const { return pixel_factor_; }
  size_t waiting() const { return waiting_.size(); }
  // How many paths more may split off now.
  uint32_t Left() const {
    return std::min(kSplitPathsOfSampleMax - count_,
                    kSplitPathsWaitingMax - static_cast<uint32_t>(waiting_.size()));
  }
  // The number of a further path. Requires: Left() > 0.
  uint32_t NextNumber() { return ++count_; }
  Sampler SamplerOf(uint32_t number) const { return sampler_->OfSplitPath(number); }
  void Push(const Waiting& waiting) { waiting_.push_back(waiting); }
  // Requires: waiting() > 0.
  Waiting Pop() {
    const Waiting last = waiting_.back();
    waiting_.pop_back();
    return last;
  }

 private:
  const Sampler* sampler_ = nullptr;
  float pixel_factor_ = 0;
  uint32_t count_ = 0;
  std::vector<Waiting> waiting_;
};

// The context with other random numbers. The sampler outlives it.
template <typename C>
Context<C> WithSampler(const Context<C>& c, const Sampler& sampler) {
  return {c.scene, c.tracer, sampler, c.counts, c.outputs, c.groups, c.guiding, c.emission};
}

// How many paths are to leave the vertex, within the limits; 1 where the field does not know.
template <typename C, typename Vertex>
float SplitNumber(const SplitPaths<C>& splits, const Vertex& vertex, const PathState<C>& path) {
  const float number =
      MaxComponent(path.throughput) * vertex.guided.split_factor() * splits.pixel_factor();
  if (!(number > 1)) return 1;  // NaN too.
  return std::min({number, kSplitNumberMax, 1 + static_cast<float>(splits.Left())});
}

// Splits the path at a vertex, before it is scattered there: scatters and stacks the others.
template <typename C, typename Vertex>
void SplitPathAt(const Context<C>& c, const Vertex& vertex, PathState<C>* path) {
  SplitPaths<C>* const splits = c.guiding.splits;
  if (splits == nullptr) return;
  const float number = SplitNumber(*splits, vertex, *path);
  if (!(number > 1)) return;
  const auto whole = static_cast<uint32_t>(number);
  const bool one_more =
      c.sampler.Get1(SplitSlot(LastVertexIndex(*path))) < number - static_cast<float>(whole);
  path->throughput *= 1 / number;
  path->roulette_scale *= number;
  path->guided.first_light /= number;
  TrainingRecords<C>* const training = c.guiding.training;
  for (uint32_t i = 1; i < whole + (one_more ? 1 : 0); ++i) {
    typename SplitPaths<C>::Waiting next{*path, splits->NextNumber()};
    const Sampler sampler = splits->SamplerOf(next.number);
    const size_t records = training != nullptr ? training->size() : 0;
    const bool continues = vertex.Scatter(WithSampler(c, sampler), &next.path);
    if (training != nullptr) next.record = training->Suspend(records);
    if (continues) splits->Push(next);
  }
  if (training != nullptr) training->set_waiting(splits->waiting());
}

// A path of the sample has ended. radiance: what all of its paths have found so far.
template <typename C>
void NotePathEnd(const Context<C>& c, const typename C::Color& radiance) {
  if (c.guiding.training == nullptr) return;
  const size_t waiting = c.guiding.splits != nullptr ? c.guiding.splits->waiting() : 0;
  c.guiding.training->Close(radiance, c.counts.rays, waiting);
}

// Takes the last path of those that wait. Its radiance continues from that of the others. Returns
// its number; 0 if none waits. Requires: paths are split.
template <typename C>
uint32_t TakeWaiting(const Context<C>& c, const typename C::Color& radiance, PathState<C>* path) {
  SplitPaths<C>& splits = *c.guiding.splits;
  if (splits.waiting() == 0) return 0;
  const typename SplitPaths<C>::Waiting next = splits.Pop();
  *path = next.path;
  path->radiance = radiance;
  if (c.guiding.training != nullptr) {
    c.guiding.training->Resume(next.record, radiance, c.counts.rays, splits.waiting());
  }
  return next.number;
}

}  // namespace sheaf::render
