// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LensDescription: a lens as its maker's prescription says, surface by surface, and the film behind
// it: what pbrt-v4's realistic camera is given.
#pragma once

#include <string>
#include <vector>

namespace sheaf {

// One line of a lens file. Surfaces come from the scene to the film.
struct LensSurface {
  double curvature_radius_mm = 0;   // Above 0: its centre lies towards the film. 0: it is flat.
  double thickness_mm = 0;          // Along the axis to the next surface, or to the film.
  double eta = 1;                   // Of the matter behind it, towards the film.
  double aperture_diameter_mm = 0;  // Of what lets light through.
};

struct LensDescription {
  std::vector<LensSurface> surfaces;  // At least one; the last thickness is replaced by focusing.
  std::string file;                   // Canonical name of the lens file.
  float aperture_diameter_mm = 1;     // Of the aperture stop, at most what the file has there.
  float focus_distance_m = 10;        // From the film.
  float film_diagonal_mm = 35;
  // What the stop's opening looks like: a disk, or within the square around that disk one of
  // pbrt-v4's shapes or a picture, scaled to let as much light through as the disk.
  enum class Aperture { kDisk, kGaussian, kSquare, kPentagon, kStar, kPicture };
  Aperture aperture = Aperture::kDisk;
  std::string aperture_file;  // Canonical name for FileSource of kPicture; its top is up.
};

// Between matter of one index, a flat surface is an aperture stop.
inline double EtaBefore(const LensDescription& lens, size_t i) {
  return i == 0 ? 1 : lens.surfaces[i - 1].eta;
}
inline bool IsStop(const LensDescription& lens, size_t i) {
  return lens.surfaces[i].curvature_radius_mm == 0 && lens.surfaces[i].eta == EtaBefore(lens, i);
}

}  // namespace sheaf
