// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RunChain: a chain of mutations of fixed length from one sample, the seed. It spreads what the
// seed brings over the states that it visits. States are visited by the Metropolis-Hastings rule,
// so that the chain keeps the density that is proportional to their targets. Seeds are samples
// whose numbers are uniform, and each deposits its target in equal parts at the states of its
// chain. So the sum of all deposits at a state is its target on average, whatever the chain's
// length: no start-up, and no normalization.
//
// A step deposits at its proposal by the probability of acceptance, and at its state by the rest,
// which has the same mean as a deposit at the next state and less noise.
//
// Sources: Cline, Talbot and Egbert 2005, "Energy Redistribution Path Tracing"; Veach and Guibas
// 1997, "Metropolis Light Transport" (expected deposits).
#pragma once

#include <algorithm>
#include <cstdint>

#include "worker/render/sampling/mutated_sampler.h"

namespace sheaf::render {

// seed: the state that the sampler's numbers give; sampler: Begin has been called, with a key of
// the chain. evaluate(): the state of the sampler's present numbers. deposit(state, part): a part
// of the chain's deposits is at the state; called for all states but the seed. Returns the part at
// the seed; all parts together are 1. Requires: 1 <= states <= kChainStatesMax, and
// seed.target > 0. State: a value with a member `double target`, finite and not negative.
template <typename State, typename Evaluate, typename Deposit>
double RunChain(uint32_t states, const State& seed, MutatedSampler* sampler,
                const Evaluate& evaluate, const Deposit& deposit) {
  const double share = 1.0 / states;
  double at_seed = 0;
  State state = seed;
  bool is_seed = true;
  double held = share;  // The part that is deposited at the state.
  const auto leave = [&] {
    if (is_seed) {
      at_seed = held;
    } else {
      deposit(state, held);
    }
  };
  for (uint32_t step = 1; step < states; ++step) {
    sampler->Propose();
    const State proposal = evaluate();
    const double accepted = std::min(1.0, proposal.target / state.target);
    held += share * (1 - accepted);
    if (sampler->ChoiceOfStep() < accepted) {
      leave();
      sampler->Accept();
      state = proposal;
      is_seed = false;
      held = share * accepted;
    } else if (accepted > 0) {
      deposit(proposal, share * accepted);
    }
  }
  leave();
  return at_seed;
}

}  // namespace sheaf::render
