// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of lens files. Memory is bounded by its limits.
#include "common/scene/formats/lens_reader.h"

#include <cmath>

#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(lens) {
  const testing::MemoryFile file(bytes);
  const absl::StatusOr<std::vector<LensSurface>> lens = ReadLens("a.dat", file.Path());
  if (!lens.ok()) return;
  SHEAF_CHECK(!lens->empty() && lens->size() <= kLensSurfacesMax);
  for (const LensSurface& surface : *lens) {
    SHEAF_CHECK(std::isfinite(surface.curvature_radius_mm) && std::isfinite(surface.thickness_mm));
    SHEAF_CHECK(surface.eta > 0 && std::isfinite(surface.eta));
    SHEAF_CHECK(surface.aperture_diameter_mm > 0 && std::isfinite(surface.aperture_diameter_mm));
  }
}

}  // namespace sheaf
