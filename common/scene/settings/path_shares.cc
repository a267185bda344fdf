// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/path_shares.h"

#include "absl/strings/str_cat.h"

namespace sheaf {

std::string WhyNoSharing(const FrameSettings& settings) {
  const bool mutates = MutatesPaths(settings.techniques);
  const std::string who = settings.IsStereo() ? "eyes" : "pixels";
  if (mutates && !(settings.techniques == TechniqueSet{Technique::kMutations})) {
    return absl::StrCat(
        "mutations are of paths from the camera alone, not of those of the "
        "techniques ",
        settings.techniques.Without(Technique::kMutations).Name(),
        "; use --techniques camera+mutations");
  }
  if (mutates && settings.IsStereo()) {
    return "the eyes of a stereo frame share no mutations; remove --stereo or the mutations";
  }
  if (!IsWholeFilm(settings)) {
    return absl::StrCat("a frame whose ", who, " share paths is rendered whole; remove the crop");
  }
  const TechniqueSet others = settings.techniques.Without(Technique::kSharing);
  if (!mutates && !(others == TechniqueSet::kCamera)) {
    return absl::StrCat(who, " share paths from the camera alone, not those of the techniques ",
                        others.Name(),
                        "; use --techniques camera, camera+sharing or camera+sharing+views");
  }
  if (settings.light_samples != 0) {
    return absl::StrCat(who, " share one light sample at a vertex; remove --light-samples");
  }
  if (!settings.outputs.empty()) {
    return "an image of shared paths has no layers beside R, G, B, A, albedo, normal, depth and "
           "errors; remove the outputs";
  }
  if (!settings.lattice.All())
    return absl::StrCat(who, " that share paths cannot be rendered alone");
  return "";
}

absl::Status CheckSharing(const FrameSettings& settings) {
  if (!ReachesFarPixels(settings.techniques)) return absl::OkStatus();
  const std::string why_not = WhyNoSharing(settings);
  if (why_not.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("--techniques ", settings.techniques.Name(), ": ", why_not));
}

}  // namespace sheaf
