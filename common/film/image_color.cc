// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/image_color.h"

#include "absl/strings/match.h"

namespace sheaf {
namespace {

struct Definition {
  const char* name;
  Chromaticities chromaticities;
};
// Indexed by Primaries.
constexpr std::array<Definition, kPrimariesCount> kDefinitions{
    {{"srgb", {}},
     {"aces2065-1", {{0.7347, 0.2653}, {0, 1}, {0.0001, -0.077}, {0.32168, 0.33767}}},
     {"rec2020", {{0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}, {0.3127, 0.3290}}},
     {"dci-p3", {{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, {0.3127, 0.3290}}},
     {"acescg", {{0.713, 0.293}, {0.165, 0.830}, {0.128, 0.044}, {0.32168, 0.33767}}}}};

}  // namespace

std::array<float, 8> Chromaticities::AsStored() const {
  std::array<float, 8> stored{};
  size_t i = 0;
  for (const Vec2d& xy : {red, green, blue, white}) {
    stored[i++] = static_cast<float>(xy.x);
    stored[i++] = static_cast<float>(xy.y);
  }
  return stored;
}

Chromaticities Chromaticities::FromStored(const std::array<float, 8>& xy) {
  // The named ones in full precision: a file that is read back converts as it did before it was
  // written.
  for (const Definition& definition : kDefinitions) {
    if (definition.chromaticities.AsStored() == xy) return definition.chromaticities;
  }
  const auto at = [&xy](size_t i) {
    return Vec2d{static_cast<double>(xy[2 * i]), static_cast<double>(xy[2 * i + 1])};
  };
  return {at(0), at(1), at(2), at(3)};
}

const char* PrimariesName(Primaries primaries) {
  return kDefinitions[static_cast<size_t>(primaries)].name;
}

std::optional<Primaries> PrimariesFromName(const std::string& name) {
  for (size_t i = 0; i < kPrimariesCount; ++i) {
    if (absl::EqualsIgnoreCase(name, kDefinitions[i].name)) return static_cast<Primaries>(i);
  }
  return std::nullopt;
}

std::vector<std::string> PrimariesNames() {
  std::vector<std::string> names;
  for (const Definition& definition : kDefinitions) names.emplace_back(definition.name);
  return names;
}

Chromaticities ChromaticitiesOf(Primaries primaries) {
  return kDefinitions[static_cast<size_t>(primaries)].chromaticities;
}

std::optional<Matrix4> XyzFromRgb(const Chromaticities& chromaticities) {
  // Each primary is a column (x, y, 1 - x - y), scaled such that they add up to the white. Source:
  // SMPTE RP 177-1993.
  const Vec2d& white = chromaticities.white;
  if (white.y == 0) return std::nullopt;
  Matrix4 columns, inverse;
  size_t column = 0;
  for (const Vec2d& xy : {chromaticities.red, chromaticities.green, chromaticities.blue}) {
    columns.m[0][column] = xy.x;
    columns.m[1][column] = xy.y;
    columns.m[2][column++] = 1 - xy.x - xy.y;
  }
  if (!Invert(columns, &inverse)) return std::nullopt;
  const Vec3d scale =
      TransformVector(inverse, {white.x / white.y, 1, (1 - white.x - white.y) / white.y});
  for (size_t row = 0; row < 3; ++row) {
    for (size_t i = 0; i < 3; ++i) columns.m[row][i] *= scale[i];
  }
  if (!Invert(columns, &inverse)) return std::nullopt;
  return columns;
}

std::optional<Matrix4> RgbFromRgb(const Chromaticities& to, const Chromaticities& from) {
  if (to == from) return Matrix4();
  const std::optional<Matrix4> xyz_from_to = XyzFromRgb(to), xyz_from_rgb = XyzFromRgb(from);
  Matrix4 to_from_xyz;
  if (!xyz_from_to || !xyz_from_rgb || !Invert(*xyz_from_to, &to_from_xyz)) return std::nullopt;
  return to_from_xyz * *xyz_from_rgb;
}

}  // namespace sheaf
