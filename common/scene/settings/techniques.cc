// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/techniques.h"

namespace sheaf {

const char* TechniquesName(Techniques techniques) {
  switch (techniques) {
    case Techniques::kCamera:
      return "camera";
    case Techniques::kCameraAndLight:
      return "camera+light";
    case Techniques::kLight:
      return "light";
    case Techniques::kCameraGuided:
      return "camera+guiding";
    case Techniques::kCameraAndLightGuided:
      return "camera+light+guiding";
    case Techniques::kCameraGuidedSplit:
      return "camera+guiding+splitting";
    case Techniques::kCameraAndLightGuidedSplit:
      return "camera+light+guiding+splitting";
  }
  return "unknown";
}

std::optional<Techniques> TechniquesFromName(const std::string& name) {
  for (int i = 0; i < kTechniquesCount; ++i) {
    const auto techniques = static_cast<Techniques>(i);
    if (name == TechniquesName(techniques)) return techniques;
  }
  return std::nullopt;
}

std::vector<std::string> TechniquesNames() {
  std::vector<std::string> names;
  for (int i = 0; i < kTechniquesCount; ++i) {
    names.emplace_back(TechniquesName(static_cast<Techniques>(i)));
  }
  return names;
}

Techniques TechniquesOfIntegrator(const std::string& integrator) {
  if (integrator == "bdpt" || integrator == "mlt" || integrator == "sppm") {
    return Techniques::kCameraAndLight;
  }
  return integrator == "lightpath" ? Techniques::kLight : Techniques::kCamera;
}

}  // namespace sheaf
