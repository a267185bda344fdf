// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
#include "common/film/error/compare.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/film/error/flip.h"

namespace sheaf {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::array<const char*, 3> kColor{"R", "G", "B"};
constexpr std::array<const char*, 3> kColorError{"stderr.R", "stderr.G", "stderr.B"};

using ColorPlanes = std::array<const std::vector<float>*, 3>;

absl::StatusOr<ColorPlanes> FindPlanes(const FrameImage& image,
                                       const std::array<const char*, 3>& names,
                                       const std::string& which) {
  ColorPlanes planes{};
  for (size_t i = 0; i < 3; ++i) {
    planes[i] = image.Find(names[i]);
    if (planes[i] == nullptr) {
      return absl::InvalidArgumentError(absl::StrCat("the ", which, " has no channel ", names[i]));
    }
  }
  return planes;
}

struct Pair {
  ColorPlanes reference, image;
};
absl::StatusOr<Pair> MatchImages(const FrameImage& reference, const FrameImage& image) {
  if (reference.window.Width() != image.window.Width() ||
      reference.window.Height() != image.window.Height()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the images have different sizes: the reference ", reference.window.Width(),
                     "x", reference.window.Height(), ", the image ", image.window.Width(), "x",
                     image.window.Height()));
  }
  if (!(reference.color.chromaticities == image.color.chromaticities)) {
    return absl::InvalidArgumentError(
        "the images have different primaries; convert one (ConvertColor)");
  }
  const absl::StatusOr<ColorPlanes> r = FindPlanes(reference, kColor, "reference");
  if (!r.ok()) return r.status();
  const absl::StatusOr<ColorPlanes> x = FindPlanes(image, kColor, "image");
  if (!x.ok()) return x.status();
  return Pair{*r, *x};
}

// Only R, G and B.
FrameImage ColorsOf(const FrameImage& image, const ColorPlanes& planes) {
  FrameImage colors;
  colors.window = image.window;
  colors.color.chromaticities = image.color.chromaticities;
  for (size_t i = 0; i < 3; ++i) {
    colors.channel_names.emplace_back(kColor[i]);
    colors.planes.push_back(*planes[i]);
  }
  return colors;
}

double RatioOfMeans(double image, double reference) {
  if (reference != 0) return image / reference;
  return image == 0 ? 1 : kInfinity;
}

// Sums over one channel of both images.
struct ChannelSums {
  double reference = 0, image = 0, squares = 0;
  uint64_t count = 0;
};
ChannelSums SumChannel(const std::vector<float>& reference, const std::vector<float>& image,
                       Comparison* result) {
  ChannelSums sums;
  for (size_t p = 0; p < reference.size(); ++p) {
    const double r = reference[p], x = image[p];
    if (!std::isfinite(r) || !std::isfinite(x)) {
      ++result->nonfinite_count;
      continue;
    }
    sums.reference += r;
    sums.image += x;
    sums.squares += (x - r) * (x - r);
    ++sums.count;
    result->max_abs_difference = std::max(result->max_abs_difference, std::fabs(x - r));
  }
  return sums;
}

double RelativeSquares(const std::vector<float>& reference, const std::vector<float>& image,
                       double floor) {
  double sum = 0;
  for (size_t p = 0; p < reference.size(); ++p) {
    const double r = reference[p], x = image[p];
    if (!std::isfinite(r) || !std::isfinite(x) || x == r) continue;
    sum += (x - r) * (x - r) / (r * r + floor * floor);
  }
  return sum;
}

double FractionDiffering(const Pair& pair) {
  const size_t size = pair.image[0]->size();
  size_t differing = 0;
  for (size_t p = 0; p < size; ++p) {
    bool differs = false;
    for (size_t i = 0; i < 3; ++i) {
      differs |= std::bit_cast<uint32_t>((*pair.reference[i])[p]) !=
                 std::bit_cast<uint32_t>((*pair.image[i])[p]);
    }
    differing += differs;
  }
  return static_cast<double>(differing) / static_cast<double>(size);
}

// Mean of a plane over a rectangle, and the standard error of that mean when `error` is there.
struct TileMean {
  double mean = 0, variance = 0;
};
TileMean MeanOver(const std::vector<float>& plane, const std::vector<float>* error, int32_t width,
                  PixelRect rect) {
  TileMean result;
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) {
      const size_t p = static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
      result.mean += plane[p];
      if (error != nullptr) result.variance += double{(*error)[p]} * (*error)[p];
    }
  }
  const auto count = static_cast<double>(rect.PixelCount());
  result.mean /= count;
  result.variance /= count * count;
  return result;
}

// The channel of a tile that deviates most. rect is relative to the window's corner.
TileDeviation WorstChannel(const Pair& pair, const ColorPlanes& error, int32_t width,
                           PixelRect rect, const TileDeviationLimits& limits) {
  TileDeviation worst;
  worst.excess = -kInfinity;
  for (size_t i = 0; i < 3; ++i) {
    const TileMean x = MeanOver(*pair.image[i], error[i], width, rect);
    const TileMean r = MeanOver(*pair.reference[i], nullptr, width, rect);
    const double standard_error = std::sqrt(x.variance * (1 + limits.samples_ratio));
    const double beyond = std::fabs(x.mean - r.mean) - limits.mean_fraction_max * std::fabs(r.mean);
    double excess = beyond / standard_error;
    if (standard_error == 0) excess = beyond > 0 ? kInfinity : 0;
    // A NaN mean counts as an infinite deviation.
    if (std::isnan(excess)) excess = kInfinity;
    if (excess > worst.excess) worst = {rect, i, x.mean, r.mean, standard_error, excess};
  }
  return worst;
}

}  // namespace

absl::StatusOr<Comparison> CompareImages(const FrameImage& reference, const FrameImage& image) {
  const absl::StatusOr<Pair> pair = MatchImages(reference, image);
  if (!pair.ok()) return pair.status();
  Comparison result;
  ChannelSums total;
  for (size_t i = 0; i < 3; ++i) {
    const ChannelSums sums = SumChannel(*pair->reference[i], *pair->image[i], &result);
    result.mean_ratio[i] = RatioOfMeans(sums.image, sums.reference);
    total.reference += sums.reference;
    total.image += sums.image;
    total.squares += sums.squares;
    total.count += sums.count;
  }
  result.fraction_differing = FractionDiffering(*pair);
  if (total.count == 0) return result;
  const auto count = static_cast<double>(total.count);
  result.reference_mean = total.reference / count;
  result.image_mean = total.image / count;
  result.mse = total.squares / count;
  double relative = 0;
  for (size_t i = 0; i < 3; ++i) {
    relative += RelativeSquares(*pair->reference[i], *pair->image[i], 0.1 * result.reference_mean);
  }
  result.relative_mse = relative / count;
  return result;
}

absl::StatusOr<double> PerceivedDifference(const FrameImage& reference, const FrameImage& image,
                                           FlipRange range) {
  const absl::StatusOr<Pair> pair = MatchImages(reference, image);
  if (!pair.ok()) return pair.status();
  FrameImage of_reference = ColorsOf(reference, pair->reference);
  FrameImage of_image = ColorsOf(image, pair->image);
  for (FrameImage* shown : {&of_reference, &of_image}) {
    if (absl::Status status = ConvertColor(Chromaticities(), shown); !status.ok()) return status;
  }
  const auto image_of = [](const FrameImage& shown) {
    const auto& planes = shown.planes;
    return FlipImage{shown.window.Width(),
                     shown.window.Height(),
                     {planes[0].data(), planes[1].data(), planes[2].data()}};
  };
  const FlipImage a = image_of(of_reference), b = image_of(of_image);
  return range == FlipRange::kScreen ? MeanFlip(a, b) : MeanHdrFlip(a, b);
}

absl::StatusOr<TileDeviations> FindTileDeviations(const FrameImage& reference,
                                                  const FrameImage& image,
                                                  const TileDeviationLimits& limits) {
  const absl::StatusOr<Pair> pair = MatchImages(reference, image);
  if (!pair.ok()) return pair.status();
  const absl::StatusOr<ColorPlanes> error = FindPlanes(image, kColorError, "image");
  if (!error.ok()) return error.status();
  const int32_t width = image.window.Width();
  TileDeviations result;
  for (const PixelRect& rect :
       CutTiles({0, 0, width, image.window.Height()}, limits.tile_size_px)) {
    TileDeviation worst = WorstChannel(*pair, *error, width, rect, limits);
    const PixelRect& window = image.window;
    worst.rect = {rect.x0 + window.x0, rect.y0 + window.y0, rect.x1 + window.x0,
                  rect.y1 + window.y0};
    ++result.tile_count;
    result.deviating_count += worst.excess > limits.standard_errors_max;
    result.worst.push_back(worst);
  }
  std::stable_sort(
      result.worst.begin(), result.worst.end(),
      [](const TileDeviation& a, const TileDeviation& b) { return a.excess > b.excess; });
  if (result.worst.size() > limits.worst_count_max) result.worst.resize(limits.worst_count_max);
  return result;
}

absl::StatusOr<FrameImage> DifferenceImage(const FrameImage& reference, const FrameImage& image) {
  const absl::StatusOr<Pair> pair = MatchImages(reference, image);
  if (!pair.ok()) return pair.status();
  FrameImage difference;
  difference.window = image.window;
  difference.frame_width_px = image.frame_width_px;
  difference.frame_height_px = image.frame_height_px;
  difference.color.chromaticities = image.color.chromaticities;
  for (size_t i = 0; i < 3; ++i) {
    std::vector<float> plane(pair->image[i]->size());
    for (size_t p = 0; p < plane.size(); ++p) {
      plane[p] = (*pair->image[i])[p] - (*pair->reference[i])[p];
    }
    difference.channel_names.emplace_back(kColor[i]);
    difference.planes.push_back(std::move(plane));
  }
  return difference;
}

}  // namespace sheaf
