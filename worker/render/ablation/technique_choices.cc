// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/ablation/technique_choices.h"

#include <algorithm>
#include <iterator>

#include "absl/strings/str_cat.h"

namespace sheaf::render {
namespace {

// "+splitting": the words that a set's name has and that of the other does not.
std::string WordsBeside(TechniqueSet other, TechniqueSet set) {
  return set.Name().substr(other.Name().size());
}

}  // namespace

bool IsTechniqueChoice(TechniqueSet techniques) {
  if (techniques == kChainsChoice) return true;
  if (techniques == kSharedChoice || techniques == kSharedByViewsChoice) return true;
  for (const Technique added : kAddedChoices) techniques = techniques.Without(added);
  return std::ranges::find(kPlainChoices, techniques) != std::end(kPlainChoices);
}

std::string FormatTechniqueChoices() {
  std::string plain, added;
  for (const TechniqueSet choice : kPlainChoices) {
    absl::StrAppend(&plain, plain.empty() ? "" : ", ", choice.Name());
  }
  const TechniqueSet base = TechniqueSet::kCameraAndLight;
  for (const Technique choice : kAddedChoices) {
    absl::StrAppend(&added, added.empty() ? "" : ", ", WordsBeside(base, base.With(choice)));
  }
  const TechniqueSet camera = TechniqueSet::kCamera;
  return absl::StrCat(
      "techniques: auto measures small images of the frame before it is rendered, and takes the "
      "most efficient of ",
      plain, "; of these with ", added, " where the scene has use for it; of ",
      kChainsChoice.Name(),
      " where small lamps may shine through smooth glass or by mirrors; and of ", camera.Name(),
      " with ", WordsBeside(camera, kSharedChoice), ", ", WordsBeside(camera, kSharedByViewsChoice),
      " where the frame may have it. --measure shows the choice and the gains");
}

}  // namespace sheaf::render
