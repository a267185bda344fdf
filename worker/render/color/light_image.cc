// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/color/light_image.h"

#include <algorithm>
#include <cstdint>
#include <optional>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/film/image_color.h"
#include "common/image/image_io.h"
#include "common/scene/named_as_in_scene.h"

namespace sheaf::render {
namespace {

// None where the file's primaries are those of sRGB, or not specified.
std::optional<Matrix4> SrgbFromFile(const FloatImage& image) {
  if (!image.chromaticities || image.channels == 1) return std::nullopt;
  const Chromaticities colors = Chromaticities::FromStored(*image.chromaticities);
  if (colors == Chromaticities()) return std::nullopt;
  return RgbFromRgb(Chromaticities(), colors);
}

// Returns false where a nonnegative texel gets a negative component, which is clamped to 0. Ignores
// rounding of colors on the gamut's boundary.
bool MoveToSrgb(const Matrix4& srgb_from_file, Rgb* texel) {
  const bool was_light = texel->r >= 0 && texel->g >= 0 && texel->b >= 0;
  const Vec3f moved = ToFloat(
      TransformVector(srgb_from_file, {static_cast<double>(texel->r), static_cast<double>(texel->g),
                                       static_cast<double>(texel->b)}));
  *texel = {moved.x, moved.y, moved.z};
  if (!was_light) return true;
  const float rounding = -0x1p-20f * MaxComponent(*texel);
  bool is_inside = true;
  for (size_t i = 0; i < 3; ++i) {
    is_inside = is_inside && !((*texel)[i] < rounding);
    if ((*texel)[i] < 0) (*texel)[i] = 0;
  }
  return is_inside;
}

}  // namespace

absl::StatusOr<LightImage> ReadLightImage(const SceneDescription& scene, SourceLocation location,
                                          const std::string& file, FileSource& files) {
  const std::string place = FormatLocation(scene, location);
  absl::StatusOr<std::string> path = files.LocalPath(file);
  if (!path.ok()) return Annotate(path.status(), place);
  absl::StatusOr<FloatImage> image = ReadImage(*path);
  if (!image.ok()) return Annotate(NamedAsInScene(image.status(), *path, file), place);
  if (std::max(image->width, image->height) > kLightImageSizeMax) {
    return absl::InvalidArgumentError(
        absl::StrCat(place, ": \"", file, "\" is ", image->width, " x ", image->height,
                     " pixels, but images of lights are at most ", kLightImageSizeMax,
                     " wide and high; make it smaller"));
  }
  if (image->channels != 1 && image->channels < 3) {
    return absl::InvalidArgumentError(
        absl::StrCat(place, ": \"", file, "\" has ", image->channels,
                     " channels, but needs 1 (gray) or R, G and B; convert it"));
  }
  const std::optional<Matrix4> srgb_from_file = SrgbFromFile(*image);
  uint64_t outside = 0;
  LightImage result{image->width, image->height, {}};
  result.texels.reserve(static_cast<size_t>(image->width) * static_cast<size_t>(image->height));
  const auto channel = [&](int x, int y, int c) {
    const float value = image->At(x, y, image->channels == 1 ? 0 : c);
    return image->is_integer ? DecodeSrgb(value) : value;
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

}  // namespace sheaf::render
