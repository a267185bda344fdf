// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Samples for tests of the film: a pure function of pixel and sample index, like a renderer's.
#pragma once

#include <cstdint>
#include <cstring>

#include "common/film/film_tile.h"

namespace sheaf {

// Uniform in [0, 1). Source: Steele et al. 2014, SplitMix64.
inline float HashToUnit(uint64_t key) {
  key += 0x9e3779b97f4a7c15;
  key = (key ^ (key >> 30)) * 0xbf58476d1ce4e5b9;
  key = (key ^ (key >> 27)) * 0x94d049bb133111eb;
  return static_cast<float>((key ^ (key >> 31)) >> 40) * 0x1p-24f;
}

// Noisy, with signed weights and values over six orders of magnitude.
inline FilmSample MakeTestSample(int32_t x, int32_t y, uint64_t n) {
  const uint64_t pixel =
      static_cast<uint64_t>(static_cast<uint32_t>(x)) << 32 | static_cast<uint32_t>(y);
  uint64_t key = pixel * 0x2545f4914f6cdd1d + n * 64;
  const auto next = [&key] { return HashToUnit(key++); };
  FilmSample s;
  const float bright = next() < 0.05f ? 1e5f : 1.0f;
  s.radiance = {next() * bright, next(), next() * 0.1f};
  s.alpha = next() < 0.8f ? 1.0f : 0.0f;
  s.filter_weight = next() < 0.2f ? -0.5f : 1.3f;
  s.albedo = {next(), next(), next()};
  s.normal = {next() - 0.5f, next() - 0.5f, next() - 0.5f};
  s.depth = s.alpha * next() * 100;
  return s;
}

inline FilmTile MakeTestTile(PixelRect rect, SampleBlock block) {
  FilmTile tile(rect, block);
  PixelAccumulator accumulator(&tile);
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t n = block.first; n < block.End(); ++n)
        accumulator.Add(n, MakeTestSample(x, y, n));
      accumulator.End();
    }
  }
  return tile;
}

// Stricter than ==, for which -0 equals 0.
inline bool SameBits(const FilmTile& a, const FilmTile& b) {
  if (!(a.rect() == b.rect() && a.block() == b.block())) return false;
  const size_t plane_bytes = a.plane_size() * sizeof(float);
  return std::memcmp(a.channel(FilmChannel{}), b.channel(FilmChannel{}),
                     plane_bytes * kFilmChannelCount) == 0 &&
         std::memcmp(a.replicate(0, 0), b.replicate(0, 0),
                     plane_bytes * kReplicateChannelCount * a.replicate_count()) == 0;
}

}  // namespace sheaf
