// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/camera_paths_check.h"

#include "absl/strings/str_cat.h"
#include "common/base/status.h"

namespace sheaf::cli {

absl::Status CheckCameraPaths(const std::string& what, TechniqueSet techniques) {
  if (!HasLightPaths(techniques)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      what, " know paths from the camera alone, not the techniques ", techniques.Name(),
      "; give --techniques ", techniques.Without(Technique::kLightPaths).Name(),
      " for an image of the same mean without light paths"));
}

absl::Status CheckCameraPaths(const std::string& what, const SceneDescription& scene,
                              const FrameSettings& settings) {
  absl::Status status = CheckCameraPaths(what, settings.techniques);
  if (status.ok() || TechniquesOfIntegrator(scene.sampling.integrator) != settings.techniques) {
    return status;
  }
  return Annotate(status, FormatLocation(scene, scene.sampling.integrator_location));
}

}  // namespace sheaf::cli
