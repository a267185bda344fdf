// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/traits/variant_choice.h"

#include <bit>
#include <iterator>
#include <optional>
#include <span>
#include <utility>

#include "common/base/check.h"
#include "worker/render/traits/trait_set.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

struct Entry {
  const char* name;
  TraitBits traits;
};
#define SHEAF_VARIANT_ENTRY(name, traits) {name, traits},
constexpr Entry kEntries[] = {SHEAF_RENDER_VARIANTS(SHEAF_VARIANT_ENTRY)};
constexpr Entry kLightPathEntries[] = {SHEAF_LIGHT_PATH_VARIANTS(SHEAF_VARIANT_ENTRY)};
constexpr Entry kChainEntries[] = {SHEAF_CHAIN_VARIANTS(SHEAF_VARIANT_ENTRY)};
constexpr Entry kEyeEntries[] = {SHEAF_EYE_VARIANTS(SHEAF_VARIANT_ENTRY)};
constexpr Entry kMutationEntries[] = {SHEAF_MUTATION_VARIANTS(SHEAF_VARIANT_ENTRY)};
#undef SHEAF_VARIANT_ENTRY

// Cost of the traits that a variant includes for other scenes: first by those that every path pays
// for (a path looks up its media at each segment), then by number.
std::pair<int, int> CostOf(TraitBits carried) {
  constexpr TraitBits kPaid = kPaidByEveryPath | TraitSet(Trait::kMedia);
  return {std::popcount(carried & kPaid), std::popcount(carried)};
}

std::vector<Variant> VariantsOf(std::span<const Entry> entries) {
  std::vector<Variant> variants;
  for (const Entry& entry : entries) variants.push_back({entry.name, entry.traits});
  return variants;
}

size_t ChooseAmong(std::span<const Entry> entries, TraitBits traits, bool force_generic) {
  // RGB and spectra give different images, so neither replaces the other.
  constexpr TraitBits kColor = TraitSet(Trait::kSpectral);
  if (force_generic) traits |= kAllTraits;
  std::optional<size_t> best;
  for (size_t i = 0; i < entries.size(); ++i) {
    const TraitBits held = entries[i].traits;
    if ((traits & ~held) != 0 || (held & kColor) != (traits & kColor)) continue;
    if (!best || CostOf(held & ~traits) < CostOf(entries[*best].traits & ~traits)) best = i;
  }
  SHEAF_CHECK(best.has_value());
  return *best;
}

}  // namespace

std::vector<Variant> AllVariants() { return VariantsOf(kEntries); }
size_t ChooseVariant(TraitBits traits, bool force_generic) {
  return ChooseAmong(kEntries, traits, force_generic);
}

std::vector<Variant> AllLightPathVariants() { return VariantsOf(kLightPathEntries); }
size_t ChooseLightPathVariant(TraitBits traits, bool force_generic) {
  return ChooseAmong(kLightPathEntries, traits, force_generic);
}

std::vector<Variant> AllChainVariants() { return VariantsOf(kChainEntries); }
size_t ChooseChainVariant(TraitBits traits, bool force_generic) {
  return ChooseAmong(kChainEntries, traits, force_generic);
}

std::vector<Variant> AllEyeVariants() { return VariantsOf(kEyeEntries); }
size_t ChooseEyeVariant(TraitBits traits, bool force_generic) {
  return ChooseAmong(kEyeEntries, traits, force_generic);
}

std::vector<Variant> AllMutationVariants() { return VariantsOf(kMutationEntries); }
size_t ChooseMutationVariant(TraitBits traits, bool force_generic) {
  return ChooseAmong(kMutationEntries, traits, force_generic);
}

}  // namespace sheaf::render
