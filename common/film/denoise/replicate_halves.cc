// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/replicate_halves.h"

#include <algorithm>
#include <cstdint>

#include "common/base/check.h"
#include "common/math/double_float.h"
#include "common/math/transform.h"

namespace sheaf {
namespace {

struct HalfPixel {
  Vec3d mean, variance;
  double weight = 0;
  size_t count = 0;  // Replicates with samples.
};

// Light of a replicate's sums in the image's primaries, and its weight.
struct Replicate {
  Vec3d light;
  double weight = 0;
};

HalfPixel HalfOf(const std::array<Replicate, kReplicateCount>& replicates, size_t count) {
  HalfPixel half;
  half.count = count;
  Vec3d sum;
  for (size_t r = 0; r < count; ++r) {
    for (size_t i = 0; i < 3; ++i) sum[i] += replicates[r].light[i];
    half.weight += replicates[r].weight;
  }
  if (half.weight == 0) {
    half.count = 0;
    return half;
  }
  for (size_t i = 0; i < 3; ++i) half.mean[i] = sum[i] / half.weight;
  if (count < 2) return half;
  const auto n = static_cast<double>(count);
  for (size_t i = 0; i < 3; ++i) {
    double squares = 0;
    for (size_t r = 0; r < count; ++r) {
      const double residual = replicates[r].light[i] - half.mean[i] * replicates[r].weight;
      squares += residual * residual;
    }
    half.variance[i] = squares * n / ((n - 1) * half.weight * half.weight);
  }
  return half;
}

HalfPixel HalfAt(const FilmTile& sums, const ImageColor& color, uint32_t parity, size_t p) {
  std::array<Replicate, kReplicateCount> replicates;
  size_t count = 0;
  for (uint32_t slot = 0; slot < sums.replicate_count(); ++slot) {
    if ((sums.replicate_first() + slot) % 2 != parity) continue;
    Vec3d light;
    for (size_t i = 0; i < 3; ++i) light[i] = double{sums.replicate(slot, i)[p]};
    const double weight = double{sums.replicate(slot, 3)[p]};
    if (weight == 0 && light == Vec3d()) continue;
    if (!color.AsSummed()) light = TransformVector(color.light_from_srgb, light);
    replicates[count++] = {light, weight};
  }
  return HalfOf(replicates, count);
}

// Means of the guides in both halves.
std::array<std::array<float, kGuideCount>, 2> GuidesAt(const FilmTile& sums, size_t first_guide,
                                                       const std::array<HalfPixel, 2>& halves,
                                                       size_t p) {
  constexpr size_t kAlpha = 6, kDepth = 7;
  static_assert(kGuideSums[kAlpha] == FilmChannel::kAlpha &&
                kGuideSums[kDepth] == FilmChannel::kDepth);
  std::array<std::array<float, kGuideCount>, 2> guides{};
  std::array<std::array<double, kGuideCount>, 2> of_halves{};
  for (size_t k = 0; k < kGuideCount; ++k) {
    const size_t mean = first_guide + k;
    of_halves[0][k] = DoubleFloat{sums.mean(mean, 0)[p], sums.mean(mean, 1)[p]}.Value();
    of_halves[1][k] = double{sums.channel(kGuideSums[k])[p]} - of_halves[0][k];
  }
  for (size_t h = 0; h < 2; ++h) {
    for (size_t k = 0; k < kGuideCount; ++k) {
      const double by = k == kDepth ? of_halves[h][kAlpha] : halves[h].weight;
      guides[h][k] = by == 0 ? 0 : static_cast<float>(of_halves[h][k] / by);
    }
  }
  return guides;
}

}  // namespace

void ReplicateHalves::Allocate() {
  const auto size = static_cast<size_t>(window_.PixelCount());
  for (Half& half : halves_) {
    for (size_t i = 0; i < 3; ++i) {
      half.mean[i].resize(size);
      half.variance[i].resize(size);
    }
    half.replicate_count.resize(size);
    for (std::vector<float>& guide : half.guides) guide.resize(size);
  }
  even_share_.resize(size);
}

void ReplicateHalves::DevelopTile(const FilmTile& sums, const ImageColor& color) {
  const PixelRect tile = sums.rect();
  const size_t first_guide = FirstGuideMean(sums.outputs());
  SHEAF_CHECK(window_.Contains(tile) && first_guide != SIZE_MAX);
  if (empty()) Allocate();
  size_t from = 0;
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    size_t to = window_.IndexOf(tile.x0, y);
    for (int32_t x = tile.x0; x < tile.x1; ++x, ++from, ++to) {
      const std::array<HalfPixel, 2> pixel{HalfAt(sums, color, 0, from),
                                           HalfAt(sums, color, 1, from)};
      const auto guides = GuidesAt(sums, first_guide, pixel, from);
      for (size_t h = 0; h < 2; ++h) {
        for (size_t k = 0; k < kGuideCount; ++k) halves_[h].guides[k][to] = guides[h][k];
        for (size_t i = 0; i < 3; ++i) {
          halves_[h].mean[i][to] = static_cast<float>(pixel[h].mean[i]);
          halves_[h].variance[i][to] = static_cast<float>(pixel[h].variance[i]);
        }
        halves_[h].replicate_count[to] = static_cast<float>(pixel[h].count);
      }
      const double weight = pixel[0].weight + pixel[1].weight;
      even_share_[to] = weight == 0 ? 0.5F : static_cast<float>(pixel[0].weight / weight);
    }
  }
}

void ReplicateHalves::Add(const ReplicateHalves& other) {
  SHEAF_CHECK(window_ == other.window_ && !empty() && !other.empty());
  for (size_t h = 0; h < 2; ++h) {
    Half& half = halves_[h];
    const Half& added = other.halves_[h];
    for (size_t p = 0; p < even_share_.size(); ++p) {
      for (size_t i = 0; i < 3; ++i) {
        half.mean[i][p] += added.mean[i][p];
        half.variance[i][p] += added.variance[i][p];
      }
      half.replicate_count[p] = std::min(half.replicate_count[p], added.replicate_count[p]);
    }
  }
}

}  // namespace sheaf
