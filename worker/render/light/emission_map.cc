// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/emission_map.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
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
TexelPair PairAt(float coordinate, int count) {
  const float x = (std::isfinite(coordinate) ? std::clamp(coordinate, 0.0f, 1.0f) : 0.0f) *
                      static_cast<float>(count) -
                  0.5f;
  const float floor = std::floor(x);
  const int first = static_cast<int>(floor);
  return {std::max(first, 0), std::min(first + 1, count - 1), x - floor};
}

}  // namespace

absl::StatusOr<EmissionMap> EmissionMap::Make(int width, int height, std::vector<Rgb> texels) {
  EmissionMap map;
  map.width_ = width;
  map.height_ = height;
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
  map.mean_luminance_ = texels.empty() ? 0 : sum / static_cast<double>(texels.size());
  map.texels_ = std::move(texels);
  map.levels_.push_back(std::move(finest));
  while (std::max(map.levels_.back().width, map.levels_.back().height) > kSquaresMax) {
    map.AddLevel();
  }
  return map;
}

void EmissionMap::AddLevel() {
  const Level& fine = levels_.back();
  Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
  for (int y = 0; y < coarse.height; ++y) {
    for (int x = 0; x < coarse.width; ++x) {
      const int x1 = std::min(2 * x + 1, fine.width - 1), y1 = std::min(2 * y + 1, fine.height - 1);
      coarse.means.push_back(0.25f * (fine.At(2 * x, 2 * y) + fine.At(x1, 2 * y) +
                                      fine.At(2 * x, y1) + fine.At(x1, y1)));
    }
  }
  levels_.push_back(std::move(coarse));
}

Rgb EmissionMap::At(Vec2f uv) const {
  const TexelPair x = PairAt(uv.x, width_), y = PairAt(1 - uv.y, height_);
  const auto texel = [&](int column, int row) {
    return texels_[static_cast<size_t>(row) * static_cast<size_t>(width_) +
                   static_cast<size_t>(column)];
  };
  const Rgb upper =
      texel(x.first, y.first) * (1 - x.fraction) + texel(x.second, y.first) * x.fraction;
  const Rgb lower =
      texel(x.first, y.second) * (1 - x.fraction) + texel(x.second, y.second) * x.fraction;
  return upper * (1 - y.fraction) + lower * y.fraction;
}

uint64_t EmissionMap::memory_bytes() const {
  uint64_t bytes = VectorBytes(texels_, levels_);
  for (const Level& level : levels_) bytes += VectorBytes(level.means);
  return bytes;
}

double EmissionMap::MeanLuminance(Vec2f lower, Vec2f upper) const {
  const int x0 = PairAt(lower.x, width_).first, x1 = PairAt(upper.x, width_).second;
  const int y0 = PairAt(1 - upper.y, height_).first, y1 = PairAt(1 - lower.y, height_).second;
  size_t level = 0;
  while (level + 1 < levels_.size() && ((x1 >> level) - (x0 >> level) >= kSquaresMax ||
                                        (y1 >> level) - (y0 >> level) >= kSquaresMax)) {
    ++level;
  }
  double sum = 0;
  int count = 0;
  for (int y = y0 >> level; y <= y1 >> level; ++y) {
    for (int x = x0 >> level; x <= x1 >> level; ++x, ++count) {
      sum += static_cast<double>(levels_[level].At(x, y));
    }
  }
  return count > 0 ? sum / count : 0;
}

absl::StatusOr<EmissionMaps> ReadEmissionMaps(const SceneDescription& scene, FileSource& files) {
  EmissionMaps maps;
  std::map<std::string, std::shared_ptr<const EmissionMap>> known;
  for (size_t i = 0; i < scene.area_lights.size(); ++i) {
    const AreaLightDescription& light = scene.area_lights[i];
    if (light.file.empty()) continue;
    maps.resize(scene.area_lights.size());
    std::shared_ptr<const EmissionMap>& map = known[light.file];
    if (map == nullptr) {
      absl::StatusOr<LightImage> image = ReadLightImage(scene, light.location, light.file, files);
      if (!image.ok()) return image.status();
      absl::StatusOr<EmissionMap> made =
          EmissionMap::Make(image->width, image->height, std::move(image->texels));
      if (!made.ok()) {
        return absl::InvalidArgumentError(
            absl::StrCat(FormatLocation(scene, light.location), ": emission \"", light.file,
                         "\": ", std::string(made.status().message())));
      }
      map = std::make_shared<const EmissionMap>(*std::move(made));
    }
    maps[i] = map;
  }
  return maps;
}

}  // namespace sheaf::render
