// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the reader of measured materials. Memory is bounded by the file's size.
// Build with -fsanitize=fuzzer,address.
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "common/base/check.h"
#include "common/scene/formats/measured_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size_bytes) {
  const int descriptor = ::memfd_create("fuzz", 0);
  SHEAF_CHECK(descriptor >= 0);
  SHEAF_CHECK(::write(descriptor, bytes, size_bytes) == static_cast<ssize_t>(size_bytes));
  const auto data =
      sheaf::ReadMeasuredFile("a.bsdf", "/proc/self/fd/" + std::to_string(descriptor));
  ::close(descriptor);
  if (!data.ok()) return 0;
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
  return 0;
}
