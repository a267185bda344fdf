// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/emission_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/vector_bytes.h"
#include "worker/render/color/light_image.h"

namespace sheaf::render {
namespace {

// Means use at most this many squares along each axis, plus one at the edge.
constexpr int kSquaresMax = 16;

// The two texels that a coordinate lies between. At and MeanLuminance both use it, so they agree on
// the texels that count.
struct TexelPair {
  int first = 0, second = 0;
  float fraction = 0;
};
TexelPair ClampedPair(float coordinate, int count) {
  const float x = (std::isfinite(coordinate) ? std::clamp(coordinate, 0.0f, 1.0f) : 0.0f) *
                      static_cast<float>(count) -
                  0.5f;
  const float floor = std::floor(x);
  const int first = static_cast<int>(floor);
  return {std::max(first, 0), std::min(first + 1, count - 1), x - floor};
}

// A coordinate in [0, 1] at which the image has what the mirrored images have at `coordinate`.
float Mirrored(float coordinate) {
  const float x = coordinate - 2 * std::floor(0.5f * coordinate);
  return x > 1 ? 2 - x : x;
}

TexelPair PairAt(float coordinate, int count, TextureWrap wrap) {
  if (!std::isfinite(coordinate)) coordinate = 0;
  if (wrap == TextureWrap::kMirror) return ClampedPair(Mirrored(coordinate), count);
  if (wrap != TextureWrap::kRepeat) return ClampedPair(coordinate, count);
  const float x = (coordinate - std::floor(coordinate)) * static_cast<float>(count) - 0.5f;
  const float floor = std::floor(x);
  const int first = static_cast<int>(floor);
  return {first < 0 ? count - 1 : first, first + 1 < count ? first + 1 : 0, x - floor};
}

// Texels that the interval of coordinates may show: one range, or two where it passes an edge of
// repeated images.
struct TexelRanges {
  struct Range {
    int first = 0, last = 0;
  };
  std::array<Range, 2> ranges;
  int count = 1;
};
TexelRanges RangesOf(float lower, float upper, int count, TextureWrap wrap) {
  if (wrap != TextureWrap::kRepeat && wrap != TextureWrap::kMirror) {
    return {{{{PairAt(lower, count, wrap).first, PairAt(upper, count, wrap).second}}}, 1};
  }
  if (!(upper - lower < 1)) return {{{{0, count - 1}}}, 1};
  if (wrap == TextureWrap::kRepeat) {
    const double size = count;
    const double first = std::floor(static_cast<double>(lower) * size - 0.5);
    const double last = std::floor(static_cast<double>(upper) * size - 0.5) + 1;
    if (last - first + 1 >= size) return {{{{0, count - 1}}}, 1};
    const int begin = static_cast<int>(first - size * std::floor(first / size));
    const int end = begin + static_cast<int>(last - first);
    if (end < count) return {{{{begin, end}}}, 1};
    return {{{{begin, count - 1}, {0, end - count}}}, 2};
  }
  const TexelPair a = PairAt(lower, count, wrap), b = PairAt(upper, count, wrap);
  TexelRanges::Range range{std::min(a.first, b.first), std::max(a.second, b.second)};
  if (std::floor(lower) != std::floor(upper)) {
    // The interval turns around at an edge of the image.
    const bool is_at_end = std::fmod(std::floor(upper), 2.0f) != 0;
    (is_at_end ? range.last : range.first) = is_at_end ? count - 1 : 0;
  }
  return {{{range}}, 1};
}

// Widens the interval by what rounding may move a coordinate within it.
void Widen(float* lower, float* upper) {
  constexpr float kRounding = 8 * std::numeric_limits<float>::epsilon();
  const float slack = kRounding * std::max({1.0f, std::fabs(*lower), std::fabs(*upper)});
  *lower -= slack;
  *upper += slack;
}

}  // namespace

absl::StatusOr<EmissionMap> EmissionMap::Make(int width, int height, std::vector<Rgb> texels) {
  auto image = std::make_shared<Image>();
  image->width = width;
  image->height = height;
  Level finest{width, height, {}};
  finest.means.reserve(texels.size());
  double sum = 0;
  for (size_t i = 0; i < texels.size(); ++i) {
    Rgb& c = texels[i];
    if (!IsFinite(c)) {
      const auto row_size = static_cast<size_t>(width);
      return absl::InvalidArgumentError(absl::StrCat("texel (", i % row_size, ", ", i / row_size,
                                                     ") is (", c.r, ", ", c.g, ", ", c.b,
                                                     "), but light must be finite"));
    }
    c = {std::fmax(c.r, 0.0f), std::fmax(c.g, 0.0f), std::fmax(c.b, 0.0f)};
    finest.means.push_back(Luminance(c));
    sum += static_cast<double>(finest.means.back());
  }
  image->mean_luminance = texels.empty() ? 0 : sum / static_cast<double>(texels.size());
  image->texels = std::move(texels);
  image->levels.push_back(std::move(finest));
  while (std::max(image->levels.back().width, image->levels.back().height) > kSquaresMax) {
    AddLevel(image.get());
  }
  EmissionMap map;
  map.image_ = std::move(image);
  return map;
}

EmissionMap EmissionMap::Placed(const EmissionPlacement& placement) const {
  EmissionMap map = *this;
  map.placement_ = placement;
  const UvMapping& mapping = placement.mapping;
  map.has_mapping_ = !(mapping.scale_u == 1 && mapping.scale_v == 1 && mapping.offset_u == 0 &&
                       mapping.offset_v == 0 && mapping.turn_u == 0 && mapping.turn_v == 0);
  return map;
}

void EmissionMap::AddLevel(Image* image) {
  const Level& fine = image->levels.back();
  Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
  for (int y = 0; y < coarse.height; ++y) {
    for (int x = 0; x < coarse.width; ++x) {
      const int x1 = std::min(2 * x + 1, fine.width - 1), y1 = std::min(2 * y + 1, fine.height - 1);
      coarse.means.push_back(0.25f * (fine.At(2 * x, 2 * y) + fine.At(x1, 2 * y) +
                                      fine.At(2 * x, y1) + fine.At(x1, y1)));
    }
  }
  image->levels.push_back(std::move(coarse));
}

Vec2f EmissionMap::Mapped(Vec2f uv) const {
  if (!has_mapping_) return uv;
  const UvMapping& m = placement_.mapping;
  return {m.scale_u * uv.x + m.turn_u * uv.y + m.offset_u,
          m.scale_v * uv.y + m.turn_v * uv.x + m.offset_v};
}

Rgb EmissionMap::At(Vec2f uv) const {
  const Image& image = *image_;
  const Vec2f at = Mapped(uv);
  TexelPair x = PairAt(at.x, image.width, placement_.wrap_u);
  TexelPair y = PairAt(1 - at.y, image.height, placement_.wrap_v);
  if (placement_.is_nearest) {
    x.fraction = x.fraction < 0.5f ? 0 : 1;
    y.fraction = y.fraction < 0.5f ? 0 : 1;
  }
  const auto texel = [&](int column, int row) {
    return image.texels[static_cast<size_t>(row) * static_cast<size_t>(image.width) +
                        static_cast<size_t>(column)];
  };
  const Rgb upper =
      texel(x.first, y.first) * (1 - x.fraction) + texel(x.second, y.first) * x.fraction;
  const Rgb lower =
      texel(x.first, y.second) * (1 - x.fraction) + texel(x.second, y.second) * x.fraction;
  return upper * (1 - y.fraction) + lower * y.fraction;
}

uint64_t EmissionMap::memory_bytes() const {
  uint64_t bytes = VectorBytes(image_->texels, image_->levels);
  for (const Level& level : image_->levels) bytes += VectorBytes(level.means);
  return bytes;
}

double EmissionMap::MeanLuminance(Vec2f lower, Vec2f upper) const {
  const Image& image = *image_;
  if (has_mapping_) {
    const Vec2f a = Mapped(lower), b = Mapped(upper);
    const Vec2f c = Mapped({lower.x, upper.y}), d = Mapped({upper.x, lower.y});
    lower = {std::min({a.x, b.x, c.x, d.x}), std::min({a.y, b.y, c.y, d.y})};
    upper = {std::max({a.x, b.x, c.x, d.x}), std::max({a.y, b.y, c.y, d.y})};
  }
  if (has_mapping_ || placement_.wrap_u != TextureWrap::kClamp ||
      placement_.wrap_v != TextureWrap::kClamp) {
    Widen(&lower.x, &upper.x);
    Widen(&lower.y, &upper.y);
  }
  const TexelRanges columns = RangesOf(lower.x, upper.x, image.width, placement_.wrap_u);
  const TexelRanges rows = RangesOf(1 - upper.y, 1 - lower.y, image.height, placement_.wrap_v);
  double sum = 0;
  int count = 0;
  for (int i = 0; i < rows.count; ++i) {
    for (int j = 0; j < columns.count; ++j) {
      const auto [x0, x1] = columns.ranges[static_cast<size_t>(j)];
      const auto [y0, y1] = rows.ranges[static_cast<size_t>(i)];
      size_t level = 0;
      while (level + 1 < image.levels.size() && ((x1 >> level) - (x0 >> level) >= kSquaresMax ||
                                                 (y1 >> level) - (y0 >> level) >= kSquaresMax)) {
        ++level;
      }
      for (int y = y0 >> level; y <= y1 >> level; ++y) {
        for (int x = x0 >> level; x <= x1 >> level; ++x, ++count) {
          sum += static_cast<double>(image.levels[level].At(x, y));
        }
      }
    }
  }
  return count > 0 ? sum / count : 0;
}

absl::StatusOr<EmissionMaps> ReadEmissionMaps(const SceneDescription& scene, FileSource& files) {
  EmissionMaps maps;
  LightImages images(scene, files);
  std::map<std::tuple<std::string, float, float, float>, EmissionMap> known;
  for (size_t i = 0; i < scene.area_lights.size(); ++i) {
    const AreaLightDescription& light = scene.area_lights[i];
    if (light.file.empty()) continue;
    maps.resize(scene.area_lights.size());
    const std::tuple key(light.file, light.tint.r, light.tint.g, light.tint.b);
    auto map = known.find(key);
    if (map == known.end()) {
      absl::StatusOr<LightImage> image = images.Read(light.location, light.file);
      if (!image.ok()) return image.status();
      for (Rgb& texel : image->texels) texel *= light.tint;
      absl::StatusOr<EmissionMap> made =
          EmissionMap::Make(image->width, image->height, std::move(image->texels));
      if (!made.ok()) {
        return absl::InvalidArgumentError(
            absl::StrCat(FormatLocation(scene, light.location), ": emission \"", light.file,
                         "\": ", std::string(made.status().message())));
      }
      map = known.emplace(key, *std::move(made)).first;
    }
    maps[i] = std::make_shared<const EmissionMap>(map->second.Placed(light.placement));
  }
  return maps;
}

}  // namespace sheaf::render
