// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EnvironmentMap: radiance from infinity as a square equal-area map, filtered bilinearly between
// texel centres with octahedral wrap. It is sampled from the squares of a MapPartition, which
// follow its luminance where that is above the mean: made to go with scattered rays by multiple
// importance sampling, which find the rest. Space: the light's own.
//
// Speed is a matter of cache misses. The partition stays in the caches; the texels of one look-up
// lie on two cache lines as a rule, and whoever knows early where he will look can have them
// fetched while something else is done.
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
  // A direction's place in the map, in texels: both coordinates in [0, size].
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

  // d: unit. Begins to fetch what Radiance will read there.
  Place Locate(Vec3f d) const;
  // A unit direction.
  Vec3d Direction(Place place) const;
  Rgb Radiance(Place place) const;
  Rgb Radiance(Vec3f d) const { return Radiance(Locate(d)); }
  // Texels along each side.
  int size() const { return size_; }
  // Mean of the filtered map's luminance over the sphere; 0 for a black map.
  double mean_luminance() const { return mean_luminance_; }
  // A place by luminance, and its pdf, positive wherever radiance is. Begins to fetch what Radiance
  // will read there. Requires: mean_luminance() > 0.
  PlaceSample Sample(Vec2f u) const;
  // Pdf of Sample: at a place that it returned the same bits. Of a direction that has been to the
  // sphere and back, rounding makes that of the square next to it where the place is within a few
  // ulps of the edge between the two. Requires: mean_luminance() > 0.
  float Pdf(Place place) const { return partition_.Pdf(place.p) * kPerSteradian; }
  float Pdf(Vec3f d) const { return Pdf(Locate(d)); }
  // Illuminance of a plane facing +z by the rule of pbrt-v4, which takes the mean over all texels
  // where the hemisphere has half of them: half the photometric value.
  double PbrtIlluminance() const;
  size_t size_bytes() const;

 private:
  static constexpr float kPerSteradian = 0x1.45f306p-4f;  // 1 / (4 pi): the map's area is 1.
  // Texels of a cache line.
  static constexpr size_t kTileWidth = 4, kTileHeight = 2;
  // Radiance is components * scale, which is the first half of a float's bits and a power of two:
  // half the size of floats, and 2^-16 of the largest component at most beside the truth.
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
  // The texels of Radiance(place).
  void Prefetch(Place place) const;

  int size_ = 0;
  float size_f_ = 0;  // size_.
  size_t tiles_across_ = 0;
  std::vector<Tile> tiles_;
  double mean_luminance_ = 0;
  MapPartition partition_;
};

}  // namespace sheaf::render
