// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/chain_settings.h"

#include "absl/strings/str_cat.h"

namespace sheaf {

absl::Status CheckChains(const FrameSettings& settings) {
  if (!HasChains(settings.techniques)) return absl::OkStatus();
  if (!(settings.techniques == TechniqueSet{Technique::kChains})) {
    return absl::InvalidArgumentError(
        absl::StrCat("--techniques ", settings.techniques.Name(),
                     ": chains belong to paths from the camera alone; give camera+chains"));
  }
  if (settings.light_samples != 0) {
    return absl::InvalidArgumentError(
        "--techniques camera+chains: a vertex has one light sample; remove --light-samples");
  }
  if (settings.eye_distance > 0) {
    return absl::InvalidArgumentError(
        "--techniques camera+chains: the paths of two eyes have no chains; remove --stereo");
  }
  return absl::OkStatus();
}

}  // namespace sheaf
