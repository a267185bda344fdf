// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads whole images with OpenImageIO, inside the loaded module.
#pragma once

#include <memory>
#include <string>

#include <OpenImageIO/imageio.h>

#include "absl/status/statusor.h"
#include "common/image/image_io.h"

namespace sheaf {

// ReadImage of an existing file.
absl::StatusOr<FloatImage> ReadByOpenImageIO(const std::string& path,
                                             const ReadImageLimits& limits);

// Opens an existing file whose header CheckImageHeader has passed. May throw, as the library does.
absl::StatusOr<std::unique_ptr<OIIO::ImageInput>> OpenInput(const std::string& path);

// Joins a message of OpenImageIO, which contains line ends, to one line; fallback if it is empty.
std::string OneLine(std::string text, const std::string& fallback);

}  // namespace sheaf
