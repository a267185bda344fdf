// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of IES files. Memory is bounded by its limits. Build with
// -fsanitize=fuzzer,address.
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "common/base/check.h"
#include "common/scene/formats/ies_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size_bytes) {
  const int descriptor = ::memfd_create("fuzz", 0);
  SHEAF_CHECK(descriptor >= 0);
  SHEAF_CHECK(::write(descriptor, bytes, size_bytes) == static_cast<ssize_t>(size_bytes));
  const auto table = sheaf::ReadIes("a.ies", "/proc/self/fd/" + std::to_string(descriptor));
  ::close(descriptor);
  if (!table.ok()) return 0;
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
  return 0;
}
