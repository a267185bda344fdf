// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LensDescription: a lens as its maker's prescription gives it, surface by surface, and the film
// behind it: the input of pbrt-v4's realistic camera.
#pragma once

#include <string>
#include <vector>

namespace sheaf {

// One line of a lens file. Surfaces are ordered from the scene to the film.
struct LensSurface {
  double curvature_radius_mm = 0;   // Above 0: its center lies towards the film. 0: it is flat.
  double thickness_mm = 0;          // Along the axis to the next surface, or to the film.
  double eta = 1;                   // Index of the medium behind it, towards the film.
  double aperture_diameter_mm = 0;  // The region that lets light through.
};

struct LensDescription {
  std::vector<LensSurface> surfaces;  // At least one; focusing replaces the last thickness.
  std::string file;                   // Canonical name of the lens file.
  float aperture_diameter_mm = 1;     // The aperture stop's, at most the diameter in the file.
  float focus_distance_m = 10;        // From the film.
  float film_diagonal_mm = 35;
  // The shape of the stop's opening: a disk, or within the square around that disk one of pbrt-v4's
  // shapes or an image, scaled to let as much light through as the disk.
  enum class Aperture { kDisk, kGaussian, kSquare, kPentagon, kStar, kImage };
  Aperture aperture = Aperture::kDisk;
  std::string aperture_file;  // kImage: canonical name for FileSource; the image's top is up.
};

// A flat surface between media of the same index is an aperture stop.
inline double EtaBefore(const LensDescription& lens, size_t i) {
  return i == 0 ? 1 : lens.surfaces[i - 1].eta;
}
inline bool IsStop(const LensDescription& lens, size_t i) {
  return lens.surfaces[i].curvature_radius_mm == 0 && lens.surfaces[i].eta == EtaBefore(lens, i);
}

}  // namespace sheaf
