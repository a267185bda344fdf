// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/lamp_rims.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <string>

#include "common/base/check.h"
#include "common/film/error_planes.h"
#include "common/film/light_path_kind.h"
#include "common/scene/filter_value.h"
#include "coordinator/core/cell_errors.h"

namespace sheaf::coordinator {
namespace {

// The lone hit of a pixel of which the deviation is at least so much is four times what is beside.
constexpr double kHitOverBeside = kOneHitDeviationMin / (1 - kOneHitDeviationMin);
// What is beside a rim: pixels of the small picture up to so far off that show no lamp.
constexpr int32_t kBesidePx = 2;
// Directions of rims, over a quarter turn, and points of the filter across each axis.
constexpr int kDirectionCount = 8, kFilterPoints = 64;
constexpr double kOctaveParts = 8;
// Of a length of rim, for rims that are not straight and lamps that are small.
constexpr double kLengthLogDeviation = 0.2;
// Of the error of a pixel that makes its cell's, what is believed when samples are shared out.
constexpr double kBelievedShare = 1 / (1 + kLeanPixels);

using Color = std::array<double, 3>;

class SmallPicture {
 public:
  explicit SmallPicture(const FramePicture& picture) : window_(picture.window) {
    const std::string seen =
        kLightPathNames[static_cast<size_t>(LightPathKind::kSeen)].name + std::string(".");
    for (size_t i = 0; i < 3; ++i) {
      all_[i] = picture.Find(std::string(1, "RGB"[i]));
      seen_[i] = picture.Find(seen + "RGB"[i]);
      SHEAF_CHECK(all_[i] != nullptr && seen_[i] != nullptr);
    }
  }
  // Filters with negative lobes give some samples a negative weight, and their pixel the value.
  Color Seen(int32_t x, int32_t y) const { return ColorAt(seen_, x, y); }
  // Mean of the pixels about one that show no lamp of a brightness near that of `lamp`.
  std::optional<Color> Beside(int32_t x, int32_t y, const Color& lamp) const {
    Color sum{};
    int count = 0;
    for (int32_t v = std::max(y - kBesidePx, window_.y0);
         v < std::min(y + kBesidePx + 1, window_.y1); ++v) {
      for (int32_t u = std::max(x - kBesidePx, window_.x0);
           u < std::min(x + kBesidePx + 1, window_.x1); ++u) {
        if (IsLampBeside(Seen(u, v), lamp)) continue;
        const Color color = ColorAt(all_, u, v);
        for (size_t i = 0; i < 3; ++i) sum[i] += color[i];
        ++count;
      }
    }
    if (count == 0) return std::nullopt;
    for (double& value : sum) value /= count;
    return sum;
  }
  const PixelRect& window() const { return window_; }

 private:
  using Planes = std::array<const std::vector<float>*, 3>;
  Color ColorAt(const Planes& planes, int32_t x, int32_t y) const {
    const size_t p = window_.IndexOf(x, y);
    return {std::fabs((*planes[0])[p]), std::fabs((*planes[1])[p]), std::fabs((*planes[2])[p])};
  }
  static double Brightest(const Color& color) { return std::ranges::max(color); }
  static bool IsLampBeside(const Color& color, const Color& lamp) {
    return kHitOverBeside * Brightest(color) > Brightest(lamp);
  }

  PixelRect window_;
  Planes all_, seen_;
};

}  // namespace

// Points of the filter by how far along a direction they lie; what is beyond each is the share of a
// pixel whose rim is there.
std::vector<RimShare> SharesBeyondRims(const FilterDescription& filter) {
  struct Point {
    double distance_px, weight;
  };
  std::map<int, RimShare> shares;  // By octaves of the share, cut in kOctaveParts.
  for (int direction = 0; direction < kDirectionCount; ++direction) {
    const double angle = std::numbers::pi / 2 * (direction + 0.5) / kDirectionCount;
    std::vector<Point> points;
    double sum = 0;
    for (int i = 0; i < kFilterPoints * kFilterPoints; ++i) {
      const double x = (i % kFilterPoints + 0.5) / kFilterPoints * 2 - 1;
      const double y = (i / kFilterPoints + 0.5) / kFilterPoints * 2 - 1;
      points.push_back(
          {x * filter.radius_x_px * std::cos(angle) + y * filter.radius_y_px * std::sin(angle),
           std::fabs(FilterValue(filter, std::fabs(x), filter.radius_x_px) *
                     FilterValue(filter, std::fabs(y), filter.radius_y_px))});
      sum += points.back().weight;
    }
    std::ranges::sort(points, {}, &Point::distance_px);
    double beyond = 0;
    for (size_t i = 0; i + 1 < points.size(); ++i) {
      beyond += points[i].weight / sum;
      if (!(beyond > 0)) continue;
      const int part = static_cast<int>(std::floor(kOctaveParts * std::log2(beyond)));
      RimShare& share = shares[part];
      share.width_px += (points[i + 1].distance_px - points[i].distance_px) / kDirectionCount;
      share.lamp = std::min(1.0, std::exp2((part + 0.5) / kOctaveParts));
    }
  }
  std::vector<RimShare> result;
  for (const auto& [part, share] : shares) result.push_back(share);
  return result;
}

LampRims::LampRims(const FramePicture& small, int32_t shrink, double mean,
                   const FilterDescription& filter,
                   const std::function<size_t(int32_t x, int32_t y)>& cell_of)
    : stretch_px_(std::numbers::pi / 4 * shrink), floor_(0.1 * mean) {
  const SmallPicture picture(small);
  const PixelRect& window = picture.window();
  const auto cross = [&](int32_t x, int32_t y, int32_t other_x, int32_t other_y) {
    const Color lamp = picture.Seen(x, y), other = picture.Seen(other_x, other_y);
    std::array<bool, 3> brighter;
    for (size_t i = 0; i < 3; ++i) brighter[i] = lamp[i] > kHitOverBeside * other[i];
    if (std::ranges::none_of(brighter, std::identity())) return;
    const std::optional<Color> beside = picture.Beside(other_x, other_y, lamp);
    if (!beside) return;
    bool rim = false;
    for (size_t i = 0; i < 3; ++i) {
      const double hit = (lamp[i] - (*beside)[i]) / kReplicateCount;
      rim |= brighter[i] && hit > kHitOverBeside * (*beside)[i];
    }
    if (!rim) return;
    const size_t cell = cell_of(other_x * shrink + shrink / 2, other_y * shrink + shrink / 2);
    stretches_.push_back({cell, lamp, *beside});
  };
  for (int32_t y = window.y0; y < window.y1; ++y) {
    for (int32_t x = window.x0; x < window.x1; ++x) {
      if (x + 1 < window.x1) {
        cross(x, y, x + 1, y);
        cross(x + 1, y, x, y);
      }
      if (y + 1 < window.y1) {
        cross(x, y, x, y + 1);
        cross(x, y + 1, x, y);
      }
    }
  }
  if (stretches_.empty()) return;
  log_length_deviation_ =
      std::hypot(kLengthLogDeviation, 1 / std::sqrt(static_cast<double>(stretches_.size())));
  shares_ = SharesBeyondRims(filter);
}

double LampRims::LengthPx() const { return stretch_px_ * static_cast<double>(stretches_.size()); }

double LampRims::OneHitPixels(uint64_t samples) const {
  const double of_replicate = static_cast<double>(samples) / kReplicateCount;
  double pixels = 0;
  for (const RimShare& share : shares_) {
    const double miss = std::pow(1 - share.lamp, of_replicate);
    pixels += share.width_px * kReplicateCount * (1 - miss) * std::pow(miss, kReplicateCount - 1);
  }
  return pixels;
}

void LampRims::AddErrors(std::span<const uint64_t> samples, double deviations,
                         std::mt19937_64* random, std::vector<ErrorSums>* cells) const {
  const double factor = std::exp(deviations * log_length_deviation_);
  std::map<uint64_t, double> pixels_of_length;
  RareHits hits;
  for (const Stretch& stretch : stretches_) {
    const uint64_t count = samples[stretch.cell];
    const auto [known, is_new] = pixels_of_length.try_emplace(count, 0);
    if (is_new) known->second = OneHitPixels(count);
    PixelError error;
    for (size_t i = 0; i < 3; ++i) {
      const double beside = stretch.beside[i];
      const double hit = (stretch.lamp[i] - beside) / static_cast<double>(count);
      if (!(hit > kHitOverBeside * beside)) continue;
      // As AddChannelErrors has it where the pixels about are lamp and wall.
      const double value = beside + hit, least = beside * beside + floor_ * floor_;
      const double square = std::max(value * value - hit * hit, 0.25 * value * value);
      error.rare += hit * hit / (square + floor_ * floor_) / 3;
      error.rare_max += hit * hit / least / 3;
    }
    double pixels = factor * known->second * stretch_px_;
    if (random != nullptr) pixels = std::poisson_distribution<int32_t>(pixels)(*random);
    hits.Add(stretch.cell, error, pixels);
    ErrorSums& cell = (*cells)[stretch.cell];
    cell.sum += kBelievedShare * pixels * error.rare;
    cell.square_sum += kBelievedShare * pixels * error.rare * error.rare;
  }
  hits.AddVariances(cells);
}

}  // namespace sheaf::coordinator
