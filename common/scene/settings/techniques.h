// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Techniques: the ways in which the integrator finds paths between lights and the camera. All have
// the same mean; they differ in noise and cost (docs/adr/0063-light-paths.md). Thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace sheaf {

// The numbers are those of messages and of stored jobs.
enum class Techniques : uint8_t {
  // Paths from the camera alone.
  kCamera = 0,
  // Light paths too: those that begin at lights and are connected to the camera. Both kinds are
  // combined by multiple importance sampling.
  kCameraAndLight = 1,
  // Light paths find all light that they can find, and camera paths only the rest: light seen
  // directly or by specular scattering alone.
  kLight = 2,
  // kCamera with path guiding: camera paths sample directions from a learned field of the light
  // that arrives, beside their BSDFs.
  kCameraGuided = 3,
  // kCameraAndLight, whose camera paths are guided.
  kCameraAndLightGuided = 4,
  // The same, with paths from the camera that are split: several go on from a vertex, where the
  // field knows that what they find matters to the pixel and is uncertain.
  kCameraGuidedSplit = 5,
  kCameraAndLightGuidedSplit = 6,
};
inline constexpr int kTechniquesCount = 7;

// Whether paths begin at lights too; otherwise the image is that of camera paths alone.
constexpr bool HasLightPaths(Techniques techniques) {
  return techniques == Techniques::kCameraAndLight || techniques == Techniques::kLight ||
         techniques == Techniques::kCameraAndLightGuided ||
         techniques == Techniques::kCameraAndLightGuidedSplit;
}
// Whether camera paths are split.
constexpr bool SplitsPaths(Techniques techniques) {
  return techniques == Techniques::kCameraGuidedSplit ||
         techniques == Techniques::kCameraAndLightGuidedSplit;
}
// Whether camera paths are guided by a learned field.
constexpr bool IsGuided(Techniques techniques) {
  return techniques == Techniques::kCameraGuided ||
         techniques == Techniques::kCameraAndLightGuided || SplitsPaths(techniques);
}
// The same techniques without light paths; kCamera for kLight.
constexpr Techniques WithoutLightPaths(Techniques techniques) {
  if (SplitsPaths(techniques)) return Techniques::kCameraGuidedSplit;
  return IsGuided(techniques) ? Techniques::kCameraGuided : Techniques::kCamera;
}
// The same techniques without guiding, and so without splitting.
constexpr Techniques WithoutGuiding(Techniques techniques) {
  if (!IsGuided(techniques)) return techniques;
  return HasLightPaths(techniques) ? Techniques::kCameraAndLight : Techniques::kCamera;
}
// The same techniques with splitting. Requires: IsGuided.
constexpr Techniques WithSplitting(Techniques techniques) {
  return HasLightPaths(techniques) ? Techniques::kCameraAndLightGuidedSplit
                                   : Techniques::kCameraGuidedSplit;
}

// "camera", "camera+light", "light", "camera+guiding", "camera+light+guiding",
// "camera+guiding+splitting", "camera+light+guiding+splitting".
const char* TechniquesName(Techniques techniques);
std::optional<Techniques> TechniquesFromName(const std::string& name);
// In the order of the numbers.
std::vector<std::string> TechniquesNames();

// The techniques of pbrt-v4's integrator of this name; kCamera for unknown names.
Techniques TechniquesOfIntegrator(const std::string& integrator);

}  // namespace sheaf
