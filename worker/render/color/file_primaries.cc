// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/color/file_primaries.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/film/image_color.h"

namespace sheaf::render {
namespace {

bool IsFinite(const Matrix4& matrix) {
  for (const auto& row : matrix.m) {
    for (const double value : row) {
      if (!std::isfinite(value)) return false;
    }
  }
  return true;
}

}  // namespace

std::optional<Matrix4> SrgbFromFile(const std::optional<std::array<float, 8>>& chromaticities,
                                    ColorRole role, const std::string& file) {
  if (!chromaticities) return std::nullopt;
  const Chromaticities colors = Chromaticities::FromStored(*chromaticities);
  if (colors == Chromaticities()) return std::nullopt;
  std::optional<Matrix4> srgb_from_file = RgbFromRgb(Chromaticities(), colors);
  if (srgb_from_file && role != ColorRole::kIlluminant) {
    const Vec3d white = TransformVector(*srgb_from_file, {1, 1, 1});
    srgb_from_file = ScaleMatrix({1 / white.x, 1 / white.y, 1 / white.z}) * *srgb_from_file;
  }
  if (srgb_from_file && IsFinite(*srgb_from_file)) return srgb_from_file;
  LogWarning(absl::StrCat(file,
                          ": the chromaticities in its header define no colors; it is read as "
                          "sRGB, write it anew"));
  return std::nullopt;
}

bool MoveToSrgb(const Matrix4& srgb_from_file, Rgb* color) {
  const bool was_light = color->r >= 0 && color->g >= 0 && color->b >= 0;
  const Vec3f moved = ToFloat(
      TransformVector(srgb_from_file, {static_cast<double>(color->r), static_cast<double>(color->g),
                                       static_cast<double>(color->b)}));
  *color = {moved.x, moved.y, moved.z};
  if (!was_light) return true;
  const float rounding = -0x1p-20f * MaxComponent(*color);
  bool is_inside = true;
  for (size_t i = 0; i < 3; ++i) {
    is_inside = is_inside && !((*color)[i] < rounding);
    if ((*color)[i] < 0) (*color)[i] = 0;
  }
  return is_inside;
}

}  // namespace sheaf::render
