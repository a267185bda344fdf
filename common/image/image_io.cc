// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_io.h"

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/image/image_header.h"
#include "common/image/image_library.h"

namespace sheaf {

absl::Status WritePng(const std::string& path, int width, int height,
                      const std::vector<Rgb8>& pixels) {
  const absl::StatusOr<std::string> bytes = EncodePng(width, height, pixels);
  if (!bytes.ok()) return bytes.status();
  return WriteFileAtomically(path, *bytes);
}

absl::StatusOr<FloatImage> ReadImage(const std::string& path, const ReadImageLimits& limits) {
  if (absl::Status header = CheckImageHeader(path); !header.ok()) return header;
  const absl::StatusOr<const ImageLibrary*> library = LoadImageLibrary();
  if (!library.ok()) return library.status();
  return (*library)->read(path, limits);
}

}  // namespace sheaf
