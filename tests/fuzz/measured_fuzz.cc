// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of measured materials. Memory is bounded by the file's size.
#include <cmath>

#include "common/scene/formats/measured_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(measured) {
  const testing::MemoryFile file(bytes);
  const auto data = ReadMeasuredFile("a.bsdf", file.Path());
  if (!data.ok()) return;
  // Accepted data is valid.
  const size_t slices = data->phi.size() * data->theta.size();
  const size_t plane = size_t{data->shape.spectra_size} * data->shape.spectra_size;
  SHEAF_CHECK(slices > 0 && data->shape.spectra_size >= 2 && data->shape.vndf_width >= 2);
  SHEAF_CHECK(data->luminance.size() == slices * plane);
  SHEAF_CHECK(data->spectra.size() == slices * plane * data->wavelengths.size());
  SHEAF_CHECK(data->vndf.size() ==
              slices * data->shape.vndf_width * size_t{data->shape.vndf_height});
  for (const float value : data->vndf) SHEAF_CHECK(value >= 0 && std::isfinite(value));
  for (const float value : data->spectra) SHEAF_CHECK(std::isfinite(value));
}

}  // namespace sheaf
