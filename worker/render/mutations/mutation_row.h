// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TraceMutationRow: the samples of a row of pixels and their chains, for the generated files that
// compile the variants.
//
// A sample is split into a bounded part and an excess: with luminance Y above its region's
// threshold T, the excess is (1 - T/Y) of it. The pixel keeps the bounded part; chains spread the
// excess, with the excess's luminance Y - T as their target. A state is a sample of its own pixel.
// Source: Bitterli and Jarosz 2019, "Selectively Metropolised Monte Carlo Light Transport
// Simulation".
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "common/math/mix_bits.h"
#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/integrator/path_integrator.h"
#include "worker/render/mutations/mutation_chain.h"
#include "worker/render/mutations/mutation_variants.h"

namespace sheaf::render {

// Keeps the keys of chains apart from those of samples.
inline constexpr uint64_t kChainSeed = 0x6d75746174696f6eu;

// A sample as a state of chains.
struct MutatedState {
  FilmSample sample;
  int32_t x = 0, y = 0;  // Its pixel.
  double target = 0;     // The luminance of its excess; 0 where it has none.
  double excess = 0;     // The excess as a part of the sample.
};

template <TraitBits kTraits, typename Tracer>
class MutationIntegrator {
 public:
  using C = IntegratorConfig<kTraits, Tracer, DirectLight::kByBoth, PathKind::kMutated>;

  // All must outlive *this. Not thread-safe: one for each thread.
  MutationIntegrator(const CompiledScene& scene, const ChainRules& rules, Tracer& tracer,
                     RayCounts& counts)
      : scene_(scene), rules_(rules), paths_(scene, tracer, counts) {}

  // A pure function of (scene, rules, seed, pixel, sample_index).
  void TraceSample(uint64_t seed, int32_t x, int32_t y, uint64_t sample_index, MutationSink* sink) {
    const Sampler numbers(seed, x, y, sample_index, scene_.settings.one_sequence);
    MutatedSampler sampler(numbers);
    MutatedState first = StateAt(sampler, x, y);
    if (first.target > 0) {
      const double of_chain = rules_.states * rules_.ThresholdAt(x, y);
      const auto chains = static_cast<uint32_t>(
          std::clamp<double>(std::ceil(first.target / of_chain), 1, kChainsPerSampleMax));
      const uint64_t key = KeyOf(seed, x, y, sample_index);
      double at_seed = 0;
      for (uint32_t chain = 0; chain < chains; ++chain) {
        sampler.Begin(MixBits(key + chain));
        at_seed += Spread(first, chains, &sampler, sink);
      }
      first.sample.radiance *= static_cast<float>(1 - first.excess * (1 - at_seed));
    }
    sink->Add(x, y, first.sample);
  }

 private:
  uint64_t KeyOf(uint64_t seed, int32_t x, int32_t y, uint64_t sample_index) const {
    const int64_t pixel = x + int64_t{y} * scene_.settings.width_px;
    return MixBits(MixBits(MixBits(seed ^ kChainSeed) + static_cast<uint64_t>(pixel)) +
                   sample_index);
  }
  MutatedState StateAt(const MutatedSampler& sampler, int32_t x, int32_t y) {
    MutatedState state{paths_.TraceBy(sampler, x, y), x, y};
    const Rgb& radiance = state.sample.radiance;
    const double luminance = static_cast<double>(Luminance(radiance));
    const double threshold = rules_.ThresholdAt(x, y);
    // False for samples that are not finite.
    if (luminance > threshold && IsFinite(radiance)) {
      state.target = luminance - threshold;
      state.excess = state.target / luminance;
    }
    return state;
  }
  // Runs one of the chains of the sample. Returns the part of the sample's excess that stays there.
  double Spread(const MutatedState& first, uint32_t chains, MutatedSampler* sampler,
                MutationSink* sink) {
    const auto evaluate = [&] {
      const int32_t x = first.x + sampler->x(), y = first.y + sampler->y();
      const FrameSettings& settings = scene_.settings;
      const bool is_on_film = x >= 0 && x < settings.width_px && y >= 0 && y < settings.height_px;
      return is_on_film ? StateAt(*sampler, x, y) : MutatedState();
    };
    const auto deposit = [&](const MutatedState& state, double part) {
      const double factor = part / chains * first.target / state.target * state.excess *
                            static_cast<double>(state.sample.filter_weight);
      const Rgb& radiance = state.sample.radiance;
      std::array<double, 3> weighted;
      for (size_t c = 0; c < 3; ++c) weighted[c] = factor * static_cast<double>(radiance[c]);
      sink->Deposit(state.x, state.y, weighted);
    };
    return RunChain(rules_.states, first, sampler, evaluate, deposit) / chains;
  }

  const CompiledScene& scene_;
  const ChainRules& rules_;
  PathIntegrator<kTraits, Tracer, DirectLight::kByBoth, PathKind::kMutated> paths_;
};

template <TraitBits kTraits>
void TraceMutationRow(const CompiledScene& scene, const ChainRules& rules, uint64_t seed,
                      int32_t step, int32_t y, uint64_t pass, MutationSink* sink,
                      RayCounts* counts) {
  RayCounts local;
  local.majorant_factor = counts->majorant_factor;
  MutationIntegrator<kTraits, const EmbreeScene> tracer(scene, rules, *scene.tracer, local);
  for (int32_t x = 0; x < scene.settings.width_px; x += step) {
    tracer.TraceSample(seed, x, y, pass, sink);
  }
  counts->Add(local);
}

}  // namespace sheaf::render
