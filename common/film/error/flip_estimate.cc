// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/flip_estimate.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/base/check.h"
#include "common/film/error/compare.h"

namespace sheaf {
namespace {

// Sums of R, G, B and weight of pixels in a row over half of the replicates: those of even number,
// or the others. Row by row, as a tile may be the whole frame; plane by plane, in memory order.
using HalfSums = std::array<std::vector<double>, kReplicateChannelCount>;
void SumHalf(const FilmTile& sums, uint32_t parity, size_t first, size_t width, HalfSums* half) {
  for (size_t i = 0; i < half->size(); ++i) {
    std::vector<double>& row = (*half)[i];
    row.assign(width, 0);
    for (uint32_t slot = 0; slot < sums.replicate_count(); ++slot) {
      if ((sums.replicate_first() + slot) % 2 != parity) continue;
      const float* plane = sums.replicate(slot, i) + first;
      for (size_t p = 0; p < width; ++p) row[p] += double{plane[p]};
    }
  }
}

// With S and W the sums over even replicates and m the mean over all, S - m W is (a - b) / 2 times
// half of the total weight if both halves have equal weight; no weight needs to differ from 0.
Vec3d ErrorAt(const HalfSums& even, const HalfSums& odd, double count, size_t p) {
  const double weight = even[3][p] + odd[3][p];
  if (weight == 0 || count < 2) return {};
  // Samples alternate between the halves.
  const double even_count = std::ceil(count / 2), odd_count = count - even_count;
  const double scale = count / (std::sqrt(even_count * odd_count) * weight);
  Vec3d error;
  for (size_t i = 0; i < 3; ++i) {
    const double mean = (even[i][p] + odd[i][p]) / weight;
    error[i] = (even[i][p] - mean * even[3][p]) * scale;
  }
  return error;
}

}  // namespace

void ErrorSample::DevelopTile(const FilmTile& sums, const ImageColor& color) {
  const PixelRect tile = sums.rect();
  SHEAF_CHECK(tile.x0 >= window_.x0 && tile.y0 >= window_.y0 && tile.x1 <= window_.x1 &&
              tile.y1 <= window_.y1);
  for (std::vector<float>& plane : planes_) {
    plane.resize(static_cast<size_t>(window_.PixelCount()));
  }
  HalfSums even, odd;
  const auto width = static_cast<size_t>(tile.Width());
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    const size_t from = tile.IndexOf(tile.x0, y), to = window_.IndexOf(tile.x0, y);
    SumHalf(sums, 0, from, width, &even);
    SumHalf(sums, 1, from, width, &odd);
    const float* counts = sums.channel(FilmChannel::kSampleCount) + from;
    for (size_t p = 0; p < width; ++p) {
      Vec3d error = ErrorAt(even, odd, double{counts[p]}, p);
      if (!color.AsSummed()) error = TransformVector(color.light_from_srgb, error);
      for (size_t i = 0; i < 3; ++i) planes_[i][to + p] = static_cast<float>(error[i]);
    }
  }
}

void ErrorSample::Add(const ErrorSample& other) {
  SHEAF_CHECK(window_ == other.window_);
  for (size_t i = 0; i < planes_.size(); ++i) {
    if (planes_[i].empty()) planes_[i].resize(other.planes_[i].size());
    for (size_t p = 0; p < other.planes_[i].size(); ++p) planes_[i][p] += other.planes_[i][p];
  }
}

std::optional<double> EstimateFlip(const FrameImage& image, const ErrorSample& error) {
  const std::vector<float>* samples = image.Find("samples");
  SHEAF_CHECK(samples != nullptr && error.planes()[0].size() == samples->size());
  if (std::any_of(samples->begin(), samples->end(), [](float count) { return count < 2; })) {
    return std::nullopt;
  }
  FrameImage other;
  other.window = image.window;
  other.color.chromaticities = image.color.chromaticities;
  constexpr std::array<const char*, 3> kNames{"R", "G", "B"};
  for (size_t i = 0; i < 3; ++i) {
    std::vector<float> plane = *image.Find(kNames[i]);
    for (size_t p = 0; p < plane.size(); ++p) plane[p] += error.planes()[i][p];
    other.channel_names.emplace_back(kNames[i]);
    other.planes.push_back(std::move(plane));
  }
  const absl::StatusOr<double> flip = PerceivedDifference(image, other, FlipRange::kScreen);
  if (!flip.ok()) return std::nullopt;
  return *flip;
}

}  // namespace sheaf
