// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/environment_map.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "common/base/large_pages.h"
#include "common/math/elementary.h"
#include "common/math/lanes.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

// Scattered rays sample the diffuse part of the sky better than light sampling does, so places are
// chosen by the luminance above the mean. This fraction of the whole luminance is added; without it
// only scattered rays could sample the rest. Source: Karlik et al. 2019, "MIS Compensation:
// Optimizing Sampling Techniques in Multiple Importance Sampling".
constexpr float kLeastPart = 1.0f / 16;

bool IsUsable(Rgb c) { return IsFinite(c) && c.r >= 0 && c.g >= 0 && c.b >= 0; }

using Halves4 [[gnu::vector_size(8)]] = uint16_t;

float ScaleOf(uint16_t bits) { return std::bit_cast<float>(uint32_t{bits} << 16); }

}  // namespace

EnvironmentMap::Texel EnvironmentMap::Pack(Rgb radiance) {
  // 2^(field - 127) <= largest < 2^(field - 126); black counts as less than 1.
  const float largest = MaxComponent(radiance);
  const uint32_t field = largest > 0 ? std::bit_cast<uint32_t>(largest) >> 23 : 126;
  // The scale is 2^16 below the next power of two. Values too dark for a normal scale lose bits.
  const uint32_t scale_field = std::max(field, 16u) - 15;
  const float inverse_scale = std::bit_cast<float>((254 - scale_field) << 23);
  Texel texel;
  texel.scale = static_cast<uint16_t>(scale_field << 7);
  for (size_t i = 0; i < 3; ++i) {
    const float component = std::min(std::floor(radiance[i] * inverse_scale + 0.5f), 65535.0f);
    texel.components[i] = static_cast<uint16_t>(component);
  }
  return texel;
}

Rgb EnvironmentMap::Unpack(const Texel& texel) {
  const float scale = ScaleOf(texel.scale);
  return {static_cast<float>(texel.components[0]) * scale,
          static_cast<float>(texel.components[1]) * scale,
          static_cast<float>(texel.components[2]) * scale};
}

absl::StatusOr<EnvironmentMap> EnvironmentMap::Make(int size, const std::vector<Rgb>& texels) {
  EnvironmentMap map;
  map.size_ = size;
  map.size_f_ = static_cast<float>(size);
  const size_t across = static_cast<size_t>(size);
  map.tiles_across_ = (across + kTileWidth - 1) / kTileWidth;
  const size_t tile_count = map.tiles_across_ * ((across + kTileHeight - 1) / kTileHeight);
  map.tiles_.reserve(tile_count);
  AdviseHugePages(map.tiles_.data(), tile_count * sizeof(Tile));
  map.tiles_.resize(tile_count);
  std::vector<float> luminance(across * across);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const size_t index = static_cast<size_t>(y) * across + static_cast<size_t>(x);
      const Rgb texel = texels[index];
      if (!IsUsable(texel)) {
        return absl::InvalidArgumentError(
            absl::StrCat("texel (", x, ", ", y, ") is (", texel.r, ", ", texel.g, ", ", texel.b,
                         "), but radiance must be finite and not negative; repair the image"));
      }
      const Texel packed = Pack(texel);
      const auto ux = static_cast<size_t>(x), uy = static_cast<size_t>(y);
      map.tiles_[uy / kTileHeight * map.tiles_across_ + ux / kTileWidth]
          .texels[uy % kTileHeight * kTileWidth + ux % kTileWidth] = packed;
      luminance[index] = Luminance(Unpack(packed));
    }
  }
  double total = 0;
  for (const float l : luminance) total += static_cast<double>(l);
  map.mean_luminance_ = total / static_cast<double>(luminance.size());
  const auto mean = static_cast<float>(map.mean_luminance_);
  for (float& l : luminance) l = std::max(l - mean, l * kLeastPart);
  map.partition_ = MapPartition(size, luminance);
  return map;
}

EnvironmentMap::Place EnvironmentMap::Locate(Vec3f d) const {
  const Vec2f st = EqualAreaSphereToSquare(d);
  const Place place{{st.x * size_f_, st.y * size_f_}};
  Prefetch(place);
  return place;
}

Vec3d EnvironmentMap::Direction(Place place) const {
  const auto size = static_cast<double>(size_);
  return EqualAreaSquareToSphere(
      {static_cast<double>(place.p.x) / size, static_cast<double>(place.p.y) / size});
}

EnvironmentMap::PlaceSample EnvironmentMap::Sample(Vec2f u) const {
  const MapPartition::Choice choice = partition_.Choose(u);
  const Place place{choice.p};
  Prefetch(place);
  return {place, choice.pdf * kPerSteradian};
}

void EnvironmentMap::Prefetch(Place place) const {
  // At the map's edge this misses some texels that Radiance reads; locating them would cost more.
  const int x = static_cast<int>(std::max(0.0f, place.p.x - 0.5f));
  const int y = static_cast<int>(std::max(0.0f, place.p.y - 0.5f));
  __builtin_prefetch(&At(std::min(x, size_ - 1), std::min(y, size_ - 1)));
  __builtin_prefetch(&At(std::min(x + 1, size_ - 1), std::min(y + 1, size_ - 1)));
}

Rgb EnvironmentMap::Radiance(Place place) const {
  const float x = place.p.x - 0.5f, y = place.p.y - 0.5f, last = size_f_ - 1;
  if (!(x >= 0 && y >= 0 && x < last && y < last)) return RadianceAtEdge(place);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const auto weighted = [&](int tx, int ty, float weight) {
    Halves4 texel;
    std::memcpy(&texel, &At(tx, ty), sizeof texel);
    const Ints4 wide = __builtin_convertvector(texel, Ints4);
    const float scale = std::bit_cast<float>(wide[3] << 16) * weight;
    return __builtin_convertvector(wide, Floats4) * scale;
  };
  const Floats4 upper = weighted(x0, y0, (1 - fx) * (1 - fy)) + weighted(x0 + 1, y0, fx * (1 - fy));
  const Floats4 lower = weighted(x0, y0 + 1, (1 - fx) * fy) + weighted(x0 + 1, y0 + 1, fx * fy);
  const Floats4 sum = upper + lower;
  return {sum[0], sum[1], sum[2]};
}

Rgb EnvironmentMap::RadianceAtEdge(Place place) const {
  // NaN passes too, and reaches the radiance.
  const auto texel_below = [&](float v) {
    return v > -1 ? static_cast<int>(std::floor(std::min(v, size_f_ - 0.5f))) : -1;
  };
  const float x = place.p.x - 0.5f, y = place.p.y - 0.5f;
  const int x0 = texel_below(x), y0 = texel_below(y);
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const auto texel = [&](int tx, int ty) {
    const TexelPosition wrapped = WrapOctahedral({tx, ty}, size_);
    return Unpack(At(wrapped.x, wrapped.y));
  };
  return (1 - fy) * ((1 - fx) * texel(x0, y0) + fx * texel(x0 + 1, y0)) +
         fy * ((1 - fx) * texel(x0, y0 + 1) + fx * texel(x0 + 1, y0 + 1));
}

double EnvironmentMap::PbrtIlluminance() const {
  double sum = 0;
  for (int y = 0; y < size_; ++y) {
    for (int x = 0; x < size_; ++x) {
      const Vec3d d = EqualAreaSquareToSphere({(x + 0.5) / size_, (y + 0.5) / size_});
      if (d.z > 0) sum += static_cast<double>(Luminance(Unpack(At(x, y)))) * d.z;
    }
  }
  return 2 * kPi * sum / (static_cast<double>(size_) * static_cast<double>(size_));
}

size_t EnvironmentMap::size_bytes() const {
  return tiles_.size() * sizeof(Tile) + partition_.size_bytes();
}

}  // namespace sheaf::render
