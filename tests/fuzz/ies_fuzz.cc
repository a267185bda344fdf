// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of IES files. Memory is bounded by its limits.
#include <cmath>

#include "common/scene/formats/ies_reader.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {

SHEAF_FUZZ_TARGET(ies) {
  const testing::MemoryFile file(bytes);
  const auto table = ReadIes("a.ies", file.Path());
  if (!table.ok()) return;
  // Accepted tables are valid.
  SHEAF_CHECK(table->vertical_degrees.size() >= 2 && !table->horizontal_degrees.empty());
  SHEAF_CHECK(table->candelas.size() ==
              table->vertical_degrees.size() * table->horizontal_degrees.size());
  for (size_t i = 1; i < table->vertical_degrees.size(); ++i) {
    SHEAF_CHECK(table->vertical_degrees[i - 1] < table->vertical_degrees[i]);
  }
  for (size_t i = 1; i < table->horizontal_degrees.size(); ++i) {
    SHEAF_CHECK(table->horizontal_degrees[i - 1] < table->horizontal_degrees[i]);
  }
  SHEAF_CHECK(table->horizontal_degrees.front() >= 0 && table->horizontal_degrees.back() < 360);
  for (const float candela : table->candelas) SHEAF_CHECK(candela >= 0 && std::isfinite(candela));
}

}  // namespace sheaf
