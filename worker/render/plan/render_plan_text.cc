// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderPlan > text.
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "worker/render/light/choice/light_choice.h"
#include "worker/render/plan/render_plan.h"
#include "worker/render/plan/trait_names.h"

namespace sheaf::render {
namespace {

std::string JoinNames(const std::vector<std::string>& names) {
  std::string joined;
  for (const std::string& name : names) absl::StrAppend(&joined, joined.empty() ? "" : ", ", name);
  return joined;
}

}  // namespace

std::string FormatRenderPlan(const RenderPlan& plan) {
  size_t width = 0;
  for (const PlannedEffect& effect : plan.effects) width = std::max(width, effect.name.size());
  std::string text;
  for (const PlannedEffect& effect : plan.effects) {
    absl::StrAppend(&text, effect.name, std::string(width - effect.name.size() + 2, ' '),
                    effect.cause, "\n");
  }
  if (!plan.effects.empty()) {
    absl::StrAppend(&text,
                    "what each of them costs differs from scene to scene: --measure measures "
                    "it in this one\n");
  }
  if (!plan.unused.empty()) absl::StrAppend(&text, "not used: ", JoinNames(plan.unused), "\n");
  absl::StrAppend(&text, "lights: ", plan.light_count,
                  plan.light_count > kLightsWeighedMax || Has(plan.traits, Trait::kLightSplits)
                      ? ", sampled by a hierarchy\n"
                      : ", each weighted at every point\n");
  if (!plan.depth_cause.empty()) {
    absl::StrAppend(&text, "depth: ", plan.max_depth, ", ", plan.depth_cause, "\n");
  }
  for (const std::string& note : plan.notes) absl::StrAppend(&text, note, "\n");
  std::vector<std::string> carried;
  for (const TraitName& t : kTraitNames) {
    if (Has(plan.variant_traits & ~plan.traits, t.trait)) carried.emplace_back(t.name);
  }
  absl::StrAppend(&text, "variant: ", plan.variant_name);
  if (!carried.empty()) absl::StrAppend(&text, " (also supports ", JoinNames(carried), ")");
  absl::StrAppend(&text, "\n");
  return text;
}

}  // namespace sheaf::render
