// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Materials measured by the RGL's goniophotometer, in tensor files. Source: Dupuy and Jakob 2018,
// "An Adaptive Parameterization for Efficient Material Acquisition and Rendering", whose names the
// fields have.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sheaf {

// Dimensions given by the head of the file.
struct MeasuredShape {
  uint32_t phi_count = 0, theta_count = 0;  // Directions of incidence.
  uint32_t wavelength_count = 0;
  uint32_t ndf_width = 0, ndf_height = 0;  // Width is along the angle to the normal.
  uint32_t sigma_width = 0, sigma_height = 0;
  uint32_t vndf_width = 0, vndf_height = 0;
  uint32_t spectra_size = 0;  // Luminance too; both are square.

  // Otherwise directions of incidence are measured all around.
  bool IsIsotropic() const { return phi_count <= 2; }
};

// All arrays are row-major, slowest dimension first, in the unit square of (sqrt(2 theta / pi),
// phi / 2 pi + 1/2). Every number is finite; densities are 0 or more.
struct MeasuredData {
  MeasuredShape shape;
  std::vector<float> phi, theta;   // Radians, increasing: directions of incidence.
  std::vector<float> wavelengths;  // Nanometers, increasing.
  std::vector<float> ndf;          // [height][width]: density of micro-normals.
  std::vector<float> sigma;        // [height][width]: projected area towards a direction.
  std::vector<float> vndf;         // [phi][theta][height][width]: density of visible micro-normals.
  std::vector<float> luminance;    // [phi][theta][size][size], over the warp of vndf.
  std::vector<float> spectra;      // [phi][theta][wavelength][size][size], over the same warp.
  bool has_jacobian = true;        // True: multiply spectra by ndf / (4 sigma).
};

// The dimensions of the fields. Reads only the head, and checks that it declares all fields in the
// required shapes. name: of the file, for errors, which name the field.
// Errors: as TensorFile::Open.
absl::StatusOr<MeasuredShape> ReadMeasuredShape(const std::string& name, const std::string& path);
// All of the file. Memory: that of the fields, which lie within the file.
absl::StatusOr<MeasuredData> ReadMeasuredFile(const std::string& name, const std::string& path);

}  // namespace sheaf
