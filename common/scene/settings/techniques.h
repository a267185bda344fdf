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
};
inline constexpr int kTechniquesCount = 5;

// Whether paths begin at lights too; otherwise the image is that of camera paths alone.
constexpr bool HasLightPaths(Techniques techniques) {
  return techniques == Techniques::kCameraAndLight || techniques == Techniques::kLight ||
         techniques == Techniques::kCameraAndLightGuided;
}
// Whether camera paths are guided by a learned field.
constexpr bool IsGuided(Techniques techniques) {
  return techniques == Techniques::kCameraGuided || techniques == Techniques::kCameraAndLightGuided;
}
// The same techniques without light paths: kCameraGuided where guided, otherwise kCamera.
constexpr Techniques WithoutLightPaths(Techniques techniques) {
  return IsGuided(techniques) ? Techniques::kCameraGuided : Techniques::kCamera;
}
// The same techniques without guiding.
constexpr Techniques WithoutGuiding(Techniques techniques) {
  if (techniques == Techniques::kCameraGuided) return Techniques::kCamera;
  if (techniques == Techniques::kCameraAndLightGuided) return Techniques::kCameraAndLight;
  return techniques;
}

// "camera", "camera+light", "light", "camera+guiding", "camera+light+guiding".
const char* TechniquesName(Techniques techniques);
std::optional<Techniques> TechniquesFromName(const std::string& name);
// In the order of the numbers.
std::vector<std::string> TechniquesNames();

// The techniques of pbrt-v4's integrator of this name; kCamera for unknown names.
Techniques TechniquesOfIntegrator(const std::string& integrator);

}  // namespace sheaf
