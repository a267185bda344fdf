// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EnvironmentMap: radiance from infinity as a square equal-area map, filtered bilinearly between
// texel centers with octahedral wrap. Sampling uses the squares of a MapPartition, which follow the
// luminance above the mean; multiple importance sampling with scattered rays covers the rest.
// Space: the light's own.
//
// Cache misses dominate the cost. The partition stays in the caches; the texels of one lookup
// usually lie on two cache lines, and a caller that knows the direction early can prefetch them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "worker/render/sampling/map_partition.h"

namespace sheaf::render {

class EnvironmentMap {
 public:
  // Position of a direction in the map, in texels: both coordinates in [0, size].
  struct Place {
    Vec2f p;
  };
  struct PlaceSample {
    Place place;
    float pdf = 0;  // Solid angle; positive.
  };

  // Shape: texels is row-major [size][size]; row 0 is t = 0.
  // Errors: kInvalidArgument naming the first texel that is negative or not finite.
  static absl::StatusOr<EnvironmentMap> Make(int size, const std::vector<Rgb>& texels);

  // d: unit. Prefetches the texels that Radiance reads there.
  Place Locate(Vec3f d) const;
  // Returns a unit direction.
  Vec3d Direction(Place place) const;
  Rgb Radiance(Place place) const;
  Rgb Radiance(Vec3f d) const { return Radiance(Locate(d)); }
  // Number of texels along each side.
  int size() const { return size_; }
  // Mean of the filtered map's luminance over the sphere; 0 for a black map.
  double mean_luminance() const { return mean_luminance_; }
  // Samples a place by luminance; the pdf is positive wherever the radiance is. Prefetches the
  // texels that Radiance reads there. Requires: mean_luminance() > 0.
  PlaceSample Sample(Vec2f u) const;
  // The pdf of Sample, bit-identical at a place that it returned. If a place was converted to a
  // direction and back and lies within a few ulps of the edge of two squares, rounding may give the
  // other square's pdf. Requires: mean_luminance() > 0.
  float Pdf(Place place) const { return partition_.Pdf(place.p) * kPerSteradian; }
  float Pdf(Vec3f d) const { return Pdf(Locate(d)); }
  // Illuminance of a plane facing +z by pbrt-v4's rule, which takes the mean over all texels
  // although the hemisphere covers half of them: half the photometric value.
  double PbrtIlluminance() const;
  size_t size_bytes() const;

 private:
  static constexpr float kPerSteradian = 0x1.45f306p-4f;  // 1 / (4 pi): the map's area is 1.
  // Texels of one cache line.
  static constexpr size_t kTileWidth = 4, kTileHeight = 2;
  // Radiance is components * scale; scale is a power of two, stored as the upper half of a float's
  // bits. Half the size of floats; the error is at most 2^-16 of the largest component.
  struct Texel {
    std::array<uint16_t, 3> components{};
    uint16_t scale = 0;
  };
  struct alignas(64) Tile {
    std::array<Texel, kTileWidth * kTileHeight> texels;
  };
  static Texel Pack(Rgb radiance);
  static Rgb Unpack(const Texel& texel);

  // Requires: 0 <= x, y < size.
  const Texel& At(int x, int y) const {
    const auto ux = static_cast<size_t>(x), uy = static_cast<size_t>(y);
    return tiles_[uy / kTileHeight * tiles_across_ + ux / kTileWidth]
        .texels[uy % kTileHeight * kTileWidth + ux % kTileWidth];
  }
  Rgb RadianceAtEdge(Place place) const;
  // Prefetches the texels of Radiance(place).
  void Prefetch(Place place) const;

  int size_ = 0;
  float size_f_ = 0;  // size_ as float.
  size_t tiles_across_ = 0;
  std::vector<Tile> tiles_;
  double mean_luminance_ = 0;
  MapPartition partition_;
};

}  // namespace sheaf::render
