// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/film.h"

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "common/base/check.h"
#include "common/math/double_float.h"

namespace sheaf {
namespace {

double WideSum(const FilmTile& sums, FilmChannel hi, FilmChannel lo, size_t p) {
  return DoubleFloat{sums.channel(hi)[p], sums.channel(lo)[p]}.Value();
}

double Ratio(double sum, double weight) { return weight == 0 ? 0 : sum / weight; }

// The picture's planes in the order of the tile's channels they come from.
struct Planes {
  std::array<float*, 3> color, error;
  std::array<float*, 7> weighted;  // A, albedo, normal.
  float *depth, *samples, *nonfinite;
};
constexpr std::array<FilmChannel, 7> kWeighted{
    FilmChannel::kAlpha,   FilmChannel::kAlbedoR, FilmChannel::kAlbedoG, FilmChannel::kAlbedoB,
    FilmChannel::kNormalX, FilmChannel::kNormalY, FilmChannel::kNormalZ};

Planes FindPlanes(FramePicture* picture) {
  const auto find = [picture](const char* channel) {
    std::vector<float>* plane = picture->Find(channel);
    SHEAF_CHECK(plane != nullptr);
    return plane->data();
  };
  return {{find("R"), find("G"), find("B")},
          {find("stderr.R"), find("stderr.G"), find("stderr.B")},
          {find("A"), find("albedo.R"), find("albedo.G"), find("albedo.B"), find("normal.X"),
           find("normal.Y"), find("normal.Z")},
          find("depth.Z"),
          find("samples"),
          find("nonfinite")};
}

// from: pixel index in the tile; to: in the picture.
void DevelopPixel(const FilmTile& sums, size_t from, size_t to, const Planes& planes) {
  constexpr std::array<FilmChannel, 3> kHi{FilmChannel::kRedHi, FilmChannel::kGreenHi,
                                           FilmChannel::kBlueHi};
  constexpr std::array<FilmChannel, 3> kLo{FilmChannel::kRedLo, FilmChannel::kGreenLo,
                                           FilmChannel::kBlueLo};
  const double weight = WideSum(sums, FilmChannel::kWeight, FilmChannel::kWeightLo, from);
  for (size_t i = 0; i < 3; ++i) {
    planes.color[i][to] = static_cast<float>(Ratio(WideSum(sums, kHi[i], kLo[i], from), weight));
    planes.error[i][to] = static_cast<float>(ReplicateStandardError(sums, i, from));
  }
  for (size_t i = 0; i < kWeighted.size(); ++i) {
    planes.weighted[i][to] = static_cast<float>(Ratio(sums.channel(kWeighted[i])[from], weight));
  }
  const double alpha_sum = sums.channel(FilmChannel::kAlpha)[from];
  planes.depth[to] = static_cast<float>(
      weight == 0 ? 0 : Ratio(sums.channel(FilmChannel::kDepth)[from], alpha_sum));
  planes.samples[to] = sums.channel(FilmChannel::kSampleCount)[from];
  planes.nonfinite[to] = sums.channel(FilmChannel::kNonFiniteCount)[from];
}

}  // namespace

void DevelopTile(const FilmTile& sums, FramePicture* picture) {
  const PixelRect tile = sums.rect(), window = picture->window;
  SHEAF_CHECK(tile.x0 >= window.x0 && tile.y0 >= window.y0 && tile.x1 <= window.x1 &&
              tile.y1 <= window.y1);
  const Planes planes = FindPlanes(picture);
  size_t from = 0;
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    size_t to = static_cast<size_t>(y - window.y0) * static_cast<size_t>(window.Width()) +
                static_cast<size_t>(tile.x0 - window.x0);
    for (int32_t x = tile.x0; x < tile.x1; ++x) DevelopPixel(sums, from++, to++, planes);
  }
}

}  // namespace sheaf
