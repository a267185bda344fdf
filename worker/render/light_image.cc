// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light_image.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/base/status.h"
#include "common/image/image_io.h"

namespace sheaf::render {

absl::StatusOr<LightImage> ReadLightImage(const SceneDescription& scene, SourceLocation location,
                                          const std::string& file, FileSource& files) {
  const std::string place = FormatLocation(scene, location);
  absl::StatusOr<std::string> path = files.LocalPath(file);
  if (!path.ok()) return Annotate(path.status(), place);
  absl::StatusOr<FloatImage> image = ReadImage(*path);
  if (!image.ok()) return Annotate(image.status(), place);
  if (std::max(image->width, image->height) > kLightImageSizeMax) {
    return absl::InvalidArgumentError(
        absl::StrCat(place, ": \"", file, "\" is ", image->width, " x ", image->height,
                     " pixels, but pictures of lights are at most ", kLightImageSizeMax,
                     " wide and high; make it smaller"));
  }
  if (image->channels != 1 && image->channels < 3) {
    return absl::InvalidArgumentError(
        absl::StrCat(place, ": \"", file, "\" has ", image->channels,
                     " channels, but needs 1 (grey) or R, G and B; convert it"));
  }
  LightImage result{image->width, image->height, {}};
  result.texels.reserve(static_cast<size_t>(image->width) * static_cast<size_t>(image->height));
  const auto channel = [&](int x, int y, int c) {
    const float value = image->At(x, y, image->channels == 1 ? 0 : c);
    return image->is_integer ? DecodeSrgb(value) : value;
  };
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      result.texels.push_back({channel(x, y, 0), channel(x, y, 1), channel(x, y, 2)});
    }
  }
  return result;
}

}  // namespace sheaf::render
