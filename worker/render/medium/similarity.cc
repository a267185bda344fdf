// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/similarity.h"

#include <algorithm>
#include <array>
#include <variant>

#include "absl/strings/str_cat.h"

namespace sheaf::render {
namespace {

enum class Effect { kReduced, kEven, kBackward, kNoScattering };

bool Scatters(const MediumDescription& medium) {
  if (!(medium.scale > 0)) return false;
  const auto* colors = std::get_if<RgbGridMedium>(&medium.kind);
  if (colors == nullptr) return !medium.sigma_s.rgb.IsBlack();
  // Without cells sigma_s is 1.
  return colors->sigma_s.empty() || std::any_of(colors->sigma_s.begin(), colors->sigma_s.end(),
                                                [](Rgb cell) { return !cell.IsBlack(); });
}

Effect EffectOn(const MediumDescription& medium) {
  if (!Scatters(medium)) return Effect::kNoScattering;
  if (medium.g == 0) return Effect::kEven;
  return medium.g > 0 ? Effect::kReduced : Effect::kBackward;
}

// The first medium of a kind, and the number of media of that kind.
struct Found {
  std::string first;
  size_t count = 0;
};

std::string TextOf(const Found& found, const char* why) {
  return absl::StrCat(found.first, why,
                      found.count > 1 ? absl::StrCat(" (and ", found.count - 1, " more)") : "");
}

}  // namespace

std::vector<std::string> SimilarityNotes(const SceneDescription& scene, int32_t after) {
  if (after == 0) return {};
  std::array<Found, 4> found;
  for (const MediumDescription& medium : scene.media) {
    const Effect effect = EffectOn(medium);
    Found& kind = found[static_cast<size_t>(effect)];
    if (kind.count++ > 0) continue;
    kind.first = absl::StrCat(FormatLocation(scene, medium.location), ": ",
                              medium.is_subsurface ? absl::StrCat("interior of ", medium.name)
                                                   : absl::StrCat("medium \"", medium.name, "\""));
    if (effect == Effect::kReduced) {
      absl::StrAppend(&kind.first, ", g ", medium.g, " becomes 0 and sigma_s ", 1 - medium.g,
                      " of itself");
    }
  }
  const auto of = [&](Effect effect) { return found[static_cast<size_t>(effect)]; };
  std::vector<std::string> notes;
  if (of(Effect::kReduced).count == 0) {
    notes.push_back(absl::StrCat(
        "similarity: on after ", after,
        " scatterings in media, but no medium here scatters forward, so there is no bias"));
  } else {
    notes.push_back(
        absl::StrCat("similarity: BIASED after ", after,
                     " scatterings in media: light scattered more often is right on average deep "
                     "in dense media, but wrong near their boundaries, near lights in them and in "
                     "thin media; standard errors do not include the bias"));
    notes.push_back(absl::StrCat("similarity changes ", TextOf(of(Effect::kReduced), "")));
  }
  constexpr struct {
    Effect effect;
    const char* why;
  } kUnchanged[] = {{Effect::kEven, ", which scatters isotropically (g = 0)"},
                    {Effect::kBackward, ", whose g is negative: it would become denser"},
                    {Effect::kNoScattering, ", which does not scatter"}};
  for (const auto& [effect, why] : kUnchanged) {
    if (of(effect).count == 0) continue;
    notes.push_back(absl::StrCat("similarity does not change ", TextOf(of(effect), why)));
  }
  return notes;
}

}  // namespace sheaf::render
