// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RunningDensity: the density with which the other end finds the vertices that a path has passed,
// over that with which the path itself does. Densities are per area of each vertex. A path is x0
// (lens), x1 ... xk (light); distances cancel, and each vertex between has the factor
//
//   light path / camera path = backward * cosines / forward
//
// of its StepDensities. Densities of distances in media are left out: they are the same for both
// ends but on the segment that a technique connects, where none of the techniques counts them.
// Sources: Veach 1997, sec. 8.2 and 10.2; docs/adr/0127.
#pragma once

#include <cmath>
#include <cstdint>

namespace sheaf::render {

// A vertex xi of a path as densities see it. Densities are per solid angle.
struct StepDensities {
  double forward = 1;   // A path from the camera, towards x(i+1).
  double backward = 1;  // A light path, towards x(i-1).
  // |cos(xi, x(i+1))| / |cos(xi, x(i-1))| with the geometric normal; 1 in media.
  double cosines = 1;

  double LightOverCamera() const { return backward * cosines / forward; }
  double CameraOverLight() const { return forward / (backward * cosines); }
};

// The step at a vertex that scatters specularly, where both densities are infinite: their ratio is
// that of the limit of ever smoother surfaces. With h the half vector and n the relative index of
// refraction, the densities of directions are those of h times |dh / dw|: n^2 |cos| of the side
// that a path leaves to, with the shading normal. Source: Walter et al. 2007, sec. 4.2.
// share: the probability with which a path from the camera scatters, beside guiding. eta_scale:
// (index on the light's side / index on the lens's side)^2. shading_cosines: as `cosines`, with the
// shading normal.
inline StepDensities SpecularStep(double share, double eta_scale, double shading_cosines,
                                  double cosines) {
  return {share * eta_scale * shading_cosines, 1, cosines};
}

enum class PathEnd : uint8_t { kCamera, kLight };

template <PathEnd kEnd>
class RunningDensity {
 public:
  // ratio: before the first vertex; 0 where the other end does not find the path.
  void Start(double ratio) { ratio_ = ratio; }
  // The other end does not find the path.
  void Stop() { ratio_ = 0; }
  // Adds a vertex. Where the ratio leaves the range of numbers, at a vertex that is met at grazing,
  // the technique of more density stands alone, at both ends.
  void Add(const StepDensities& step) {
    if constexpr (kEnd == PathEnd::kCamera) {
      ratio_ *= step.LightOverCamera();
      if (!std::isfinite(ratio_)) ratio_ = 0;
    } else {
      ratio_ *= step.CameraOverLight();
    }
  }
  double ratio() const { return ratio_; }
  bool IsFound() const { return ratio_ > 0; }

 private:
  double ratio_ = 0;
};

}  // namespace sheaf::render
