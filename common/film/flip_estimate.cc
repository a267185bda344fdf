// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/flip_estimate.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/base/check.h"
#include "common/film/compare.h"

namespace sheaf {
namespace {

// Sums over half of the replicates: those of even number, or the others.
struct HalfSums {
  Vec3d color;
  double weight = 0;
};
HalfSums SumHalf(const FilmTile& sums, uint32_t parity, size_t p) {
  HalfSums half;
  for (uint32_t slot = 0; slot < sums.replicate_count(); ++slot) {
    if ((sums.replicate_first() + slot) % 2 != parity) continue;
    for (size_t i = 0; i < 3; ++i) half.color[i] += double{sums.replicate(slot, i)[p]};
    half.weight += double{sums.replicate(slot, 3)[p]};
  }
  return half;
}

// With S and W the sums over even replicates and m the mean over all, S - m W is (a - b) / 2 times
// half of all weight where both halves weigh the same; and no weight need differ from 0.
Vec3d ErrorAt(const FilmTile& sums, size_t p) {
  const HalfSums even = SumHalf(sums, 0, p), odd = SumHalf(sums, 1, p);
  const double weight = even.weight + odd.weight;
  const double count = sums.channel(FilmChannel::kSampleCount)[p];
  if (weight == 0 || count < 2) return {};
  // Samples are dealt to the halves in turn.
  const double even_count = std::ceil(count / 2), odd_count = count - even_count;
  const double scale = count / (std::sqrt(even_count * odd_count) * weight);
  Vec3d error;
  for (size_t i = 0; i < 3; ++i) {
    const double mean = (even.color[i] + odd.color[i]) / weight;
    error[i] = (even.color[i] - mean * even.weight) * scale;
  }
  return error;
}

}  // namespace

void ErrorSample::DevelopTile(const FilmTile& sums, const PictureColor& color) {
  const PixelRect tile = sums.rect();
  SHEAF_CHECK(tile.x0 >= window_.x0 && tile.y0 >= window_.y0 && tile.x1 <= window_.x1 &&
              tile.y1 <= window_.y1);
  for (std::vector<float>& plane : planes_) {
    plane.resize(static_cast<size_t>(window_.PixelCount()));
  }
  size_t from = 0;
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    size_t to = static_cast<size_t>(y - window_.y0) * static_cast<size_t>(window_.Width()) +
                static_cast<size_t>(tile.x0 - window_.x0);
    for (int32_t x = tile.x0; x < tile.x1; ++x, ++from, ++to) {
      Vec3d error = ErrorAt(sums, from);
      if (!color.AsSummed()) error = TransformVector(color.light_from_srgb, error);
      for (size_t i = 0; i < 3; ++i) planes_[i][to] = static_cast<float>(error[i]);
    }
  }
}

std::optional<double> EstimateFlip(const FramePicture& picture, const ErrorSample& error) {
  const std::vector<float>* samples = picture.Find("samples");
  SHEAF_CHECK(samples != nullptr && error.planes()[0].size() == samples->size());
  if (std::any_of(samples->begin(), samples->end(), [](float count) { return count < 2; })) {
    return std::nullopt;
  }
  FramePicture other;
  other.window = picture.window;
  other.color.chromaticities = picture.color.chromaticities;
  constexpr std::array<const char*, 3> kColor{"R", "G", "B"};
  for (size_t i = 0; i < 3; ++i) {
    std::vector<float> plane = *picture.Find(kColor[i]);
    for (size_t p = 0; p < plane.size(); ++p) plane[p] += error.planes()[i][p];
    other.channel_names.emplace_back(kColor[i]);
    other.planes.push_back(std::move(plane));
  }
  const absl::StatusOr<double> flip = PerceivedDifference(picture, other, FlipRange::kScreen);
  if (!flip.ok()) return std::nullopt;
  return *flip;
}

}  // namespace sheaf
