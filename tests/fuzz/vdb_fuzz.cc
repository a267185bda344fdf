// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to OpenVDB where it reads .vdb files, in confined processes of its own, and
// looks up values of accepted grids. OpenVDB may crash there; the target is what this process makes
// of its answers and ends. Each run starts processes, so there are tens a second.
#include "tests/fuzz/volume_lookups.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(vdb) {
  if (testing::BeginsAsVdb(bytes)) testing::ReadAllGrids(bytes);
}

}  // namespace sheaf
