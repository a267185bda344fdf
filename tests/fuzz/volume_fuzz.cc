// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of .nvdb files, and looks up values of accepted grids.
#include "tests/fuzz/volume_lookups.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(volume) {
  if (!testing::BeginsAsVdb(bytes)) testing::ReadAllGrids(bytes);
}

}  // namespace sheaf
