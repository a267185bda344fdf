// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/stereo.h"

#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "common/scene/settings/path_shares.h"

namespace sheaf {
namespace {

absl::Status Refused(const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat("--stereo: ", why));
}

}  // namespace

bool AreEyeDistances(float eye_distance, float eye_convergence) {
  return std::isfinite(eye_distance) && std::isfinite(eye_convergence) && eye_distance >= 0 &&
         eye_convergence >= 0;
}

std::string WhyNoStereo(const FrameSettings& settings) {
  if (!AreEyeDistances(settings.eye_distance, settings.eye_convergence)) {
    return "the distance of the eyes must be above 0, and that of convergence not below";
  }
  if (settings.width_px % 2 != 0) return "both eyes are rendered whole; remove the crop";
  return WhyNoSharing(settings);
}

absl::Status MakeStereo(const SceneDescription& scene, const RenderSettings& settings,
                        FrameSettings* resolved) {
  if (scene.camera.kind != CameraDescription::Kind::kPerspective) {
    return absl::InvalidArgumentError(
        absl::StrCat(FormatLocation(scene, scene.camera.location),
                     ": --stereo needs a perspective camera; render this one without it"));
  }
  if (!IsWholeFilm(*resolved)) return Refused("both eyes are rendered whole; remove the crop");
  if (resolved->width_px > std::numeric_limits<int32_t>::max() / 2) {
    return Refused("two films of this width are too wide");
  }
  if (!settings.techniques) resolved->techniques = TechniqueSet::kCamera;
  resolved->eye_distance = settings.eye_distance;
  resolved->eye_convergence = settings.eye_convergence;
  resolved->width_px *= 2;
  resolved->window.x1 = resolved->width_px;
  const std::string why_not = WhyNoStereo(*resolved);
  return why_not.empty() ? absl::OkStatus() : Refused(why_not);
}

}  // namespace sheaf
