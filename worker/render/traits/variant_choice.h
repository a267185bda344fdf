// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Chooses the compiled variant of the integrator that serves a set of traits at the least cost.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

struct Variant {
  std::string name;
  TraitBits traits = 0;
};

// All of variant_list.h, in its order.
std::vector<Variant> AllVariants();
// Index of the variant that contains all of `traits` and includes the cheapest others: the fewest
// of kPaidByEveryPath, then the fewest.
size_t ChooseVariant(TraitBits traits, bool force_generic);

// The same for the variants of frames with light paths.
std::vector<Variant> AllLightPathVariants();
size_t ChooseLightPathVariant(TraitBits traits, bool force_generic);

// The same for the variants of frames with chains.
std::vector<Variant> AllChainVariants();
size_t ChooseChainVariant(TraitBits traits, bool force_generic);

// The same for the variants of stereo frames.
std::vector<Variant> AllEyeVariants();
size_t ChooseEyeVariant(TraitBits traits, bool force_generic);

// The same for the variants of frames with chains of mutations.
std::vector<Variant> AllMutationVariants();
size_t ChooseMutationVariant(TraitBits traits, bool force_generic);

}  // namespace sheaf::render
