// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/color/light_image.h"

#include <cstdint>
#include <optional>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/image/image_io.h"
#include "common/scene/named_as_in_scene.h"
#include "worker/render/color/file_primaries.h"

namespace sheaf::render {
absl::StatusOr<LightImage> ReadLightImage(const SceneDescription& scene, SourceLocation location,
                                          const std::string& file, FileSource& files) {
  const std::string place = FormatLocation(scene, location);
  absl::StatusOr<std::string> path = files.LocalPath(file);
  if (!path.ok()) return Annotate(path.status(), place);
  const absl::StatusOr<FloatImage> image = ReadImage(*path, {.side_max = kLightImageSideMax});
  if (!image.ok()) {
    const absl::Status named = Annotate(NamedAsInScene(image.status(), *path, file), place);
    if (!absl::IsInvalidArgument(named)) return named;
    return absl::InvalidArgumentError(
        absl::StrCat(named.message(), "; replace the file or remove it"));
  }
  const std::optional<Matrix4> srgb_from_file = SrgbFromFile(
      image->chromaticities, ColorRole::kIlluminant, absl::StrCat(place, ": \"", file, "\""));
  uint64_t outside = 0;
  LightImage result{image->width, image->height, {}};
  result.texels.reserve(static_cast<size_t>(image->width) * static_cast<size_t>(image->height));
  const auto channel = [&](int x, int y, int c) {
    return image->At(x, y, image->channels == 1 ? 0 : c);
  };
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      Rgb texel{channel(x, y, 0), channel(x, y, 1), channel(x, y, 2)};
      if (srgb_from_file) outside += !MoveToSrgb(*srgb_from_file, &texel);
      result.texels.push_back(texel);
    }
  }
  if (outside > 0) {
    LogWarning(absl::StrCat(place, ": ", outside, " of the ", result.texels.size(), " texels of \"",
                            file, "\" are colors outside sRGB, which are clipped to its gamut"));
  }
  return result;
}

absl::StatusOr<LightImage> LightImages::Read(SourceLocation location, const std::string& file) {
  if (repeated_texels_ > repeated_texels_max_) {
    return absl::ResourceExhaustedError(
        absl::StrCat(FormatLocation(scene_, location),
                     ": images that were read for other lights add up to more ",
                     "than the limit of ", repeated_texels_max_,
                     " texels (repeated_texels_max); use fewer lights, or smaller images"));
  }
  absl::StatusOr<LightImage> image = ReadLightImage(scene_, location, file, files_);
  if (image.ok() && !read_.insert(file).second) repeated_texels_ += image->texels.size();
  return image;
}

}  // namespace sheaf::render
