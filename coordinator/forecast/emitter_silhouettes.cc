// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/emitter_silhouettes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <optional>

#include "common/film/error/error_planes.h"
#include "common/scene/filter_value.h"
#include "coordinator/core/frame/cell_errors.h"

namespace sheaf::coordinator {
namespace {

// If a single hit makes at least the fraction kOneHitDeviationMin of a pixel's value, it adds at
// least this many times (4) the value of the surroundings.
constexpr double kHitOverBeside = kOneHitDeviationMin / (1 - kOneHitDeviationMin);
// Pixels of the small image count as surroundings of a silhouette up to this distance, if they show
// no emitter.
constexpr int32_t kBesidePx = 2;
// Number of directions of silhouettes, over a quarter turn, and of filter points along each axis.
constexpr int kDirectionCount = 8, kFilterPoints = 64;
constexpr double kOctaveParts = 8;
// Log-normal deviation of a silhouette's length: silhouettes may be curved, and emitters small.
constexpr double kLengthLogDeviation = 0.2;
// The fraction of a pixel's error that its cell retains if the pixel dominates the cell's error and
// samples are distributed (cell_errors.h).
constexpr double kBelievedFraction = 1 / (1 + kLeanPixels);

using Color = EmitterColors::Color;

double Brightest(const Color& color) { return std::ranges::max(color); }

// Mean of the pixels around (x, y) whose emission is much darker than `emitter`; none if there are
// no such pixels.
std::optional<Color> Beside(const EmitterColors& seen, int32_t x, int32_t y, const Color& emitter) {
  const PixelRect about = Intersect(
      {x - kBesidePx, y - kBesidePx, x + kBesidePx + 1, y + kBesidePx + 1}, seen.window());
  Color sum{};
  int count = 0;
  for (int32_t v = about.y0; v < about.y1; ++v) {
    for (int32_t u = about.x0; u < about.x1; ++u) {
      if (kHitOverBeside * Brightest(seen.Seen(u, v)) > Brightest(emitter)) continue;
      const Color color = seen.All(u, v);
      for (size_t i = 0; i < 3; ++i) sum[i] += color[i];
      ++count;
    }
  }
  if (count == 0) return std::nullopt;
  for (double& value : sum) value /= count;
  return sum;
}

// Whether a single replicate that meets the emitter stands out in the pixels of a first round.
bool IsLoneHit(double emitter, double beside) {
  return (emitter - beside) / kReplicateCount > kHitOverBeside * beside;
}

// The probability that exactly one replicate of a pixel meets an emitter that covers the fraction
// `emitter` of the pixel's filter.
double OneHit(double emitter, double samples_of_replicate) {
  const double miss = std::pow(1 - emitter, samples_of_replicate);
  return kReplicateCount * (1 - miss) * std::pow(miss, kReplicateCount - 1);
}

}  // namespace

// Sorts the points of the filter by their distance along a direction. The weight beyond a point is
// the fraction of a pixel whose silhouette passes through that point.
std::vector<SilhouetteFraction> FractionsBeyondSilhouettes(const FilterDescription& filter) {
  struct Point {
    double distance_px, weight;
  };
  // By octaves of the fraction, each divided into kOctaveParts.
  std::map<int, SilhouetteFraction> fractions;
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
      SilhouetteFraction& fraction = fractions[part];
      fraction.width_px += (points[i + 1].distance_px - points[i].distance_px) / kDirectionCount;
      fraction.emitter = std::min(1.0, std::exp2((part + 0.5) / kOctaveParts));
    }
  }
  std::vector<SilhouetteFraction> result;
  for (const auto& [part, fraction] : fractions) result.push_back(fraction);
  return result;
}

EmitterSilhouettes::EmitterSilhouettes(const FrameImage& small, int32_t shrink,
                                       std::span<const ZoomedPilot> zoomed_pilots, double mean,
                                       const FilterDescription& filter, const PixelRect& window,
                                       const std::function<size_t(int32_t x, int32_t y)>& cell_of)
    : stretch_px_(std::numbers::pi / 4 * shrink), floor_(0.1 * mean) {
  AddStretches(EmitterColors(small), shrink, zoomed_pilots, cell_of);
  for (const ZoomedPilot& zoomed_pilot : zoomed_pilots) {
    for (const EmitterPixel& pixel : EmitterPixelsOf(zoomed_pilot, filter, window)) {
      bool is_lone = false;
      for (size_t i = 0; i < 3; ++i) is_lone |= IsLoneHit(pixel.emitter[i], pixel.beside[i]);
      if (!is_lone) continue;
      pixels_.push_back({{cell_of(pixel.x, pixel.y), pixel.emitter, pixel.beside}, pixel.fraction});
    }
  }
  if (empty()) return;
  log_length_deviation_ = kLengthLogDeviation;
  if (stretches_.empty()) return;
  log_length_deviation_ =
      std::hypot(kLengthLogDeviation, 1 / std::sqrt(static_cast<double>(stretches_.size())));
  fractions_ = FractionsBeyondSilhouettes(filter);
}

void EmitterSilhouettes::AddStretches(const EmitterColors& image, int32_t shrink,
                                      std::span<const ZoomedPilot> zoomed_pilots,
                                      const std::function<size_t(int32_t x, int32_t y)>& cell_of) {
  const PixelRect& window = image.window();
  // Zoomed pilots are more accurate where they exist.
  const auto is_close = [&](int32_t x, int32_t y) {
    const PixelRect pixel{x * shrink, y * shrink, (x + 1) * shrink, (y + 1) * shrink};
    return std::ranges::any_of(zoomed_pilots, [&](const ZoomedPilot& zoomed_pilot) {
      return !Intersect(pixel, zoomed_pilot.place.rect).IsEmpty();
    });
  };
  const auto cross = [&](int32_t x, int32_t y, int32_t other_x, int32_t other_y) {
    const Color emitter = image.Seen(x, y), other = image.Seen(other_x, other_y);
    std::array<bool, 3> brighter;
    for (size_t i = 0; i < 3; ++i) brighter[i] = emitter[i] > kHitOverBeside * other[i];
    if (std::ranges::none_of(brighter, std::identity()) || is_close(x, y)) return;
    const std::optional<Color> beside = Beside(image, other_x, other_y, emitter);
    if (!beside) return;
    bool silhouette = false;
    for (size_t i = 0; i < 3; ++i) silhouette |= brighter[i] && IsLoneHit(emitter[i], (*beside)[i]);
    if (!silhouette) return;
    const size_t cell = cell_of(other_x * shrink + shrink / 2, other_y * shrink + shrink / 2);
    stretches_.push_back({cell, emitter, *beside});
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
}

void EmitterSilhouettes::JoinCells() {
  for (Place& place : stretches_) place.cell = 0;
  for (Pixel& pixel : pixels_) pixel.place.cell = 0;
}

double EmitterSilhouettes::LengthPx() const {
  return stretch_px_ * static_cast<double>(stretches_.size());
}

double EmitterSilhouettes::OneHitPixels(uint64_t samples) const {
  const double of_replicate = static_cast<double>(samples) / kReplicateCount;
  double pixels = 0;
  for (const SilhouetteFraction& fraction : fractions_)
    pixels += fraction.width_px * OneHit(fraction.emitter, of_replicate);
  return pixels;
}

void EmitterSilhouettes::AddHits(const Place& place, uint64_t samples, double pixels,
                                 RareHits* hits, std::vector<ErrorSums>* cells) const {
  PixelError error;
  for (size_t i = 0; i < 3; ++i) {
    const double beside = place.beside[i];
    const double hit = (place.emitter[i] - beside) / static_cast<double>(samples);
    if (!(hit > kHitOverBeside * beside)) continue;
    // As in AddChannelErrors if the neighborhood consists of emitter and background.
    const double value = beside + hit, least = beside * beside + floor_ * floor_;
    const double square = std::max(value * value - hit * hit, 0.25 * value * value);
    error.rare += hit * hit / (square + floor_ * floor_) / 3;
    error.rare_max += hit * hit / least / 3;
  }
  hits->Add(place.cell, error, pixels);
  ErrorSums& cell = (*cells)[place.cell];
  cell.sum += kBelievedFraction * pixels * error.rare;
  cell.square_sum += kBelievedFraction * pixels * error.rare * error.rare;
}

void EmitterSilhouettes::AddErrors(std::span<const uint64_t> samples, double deviations,
                                   std::mt19937_64* random, std::vector<ErrorSums>* cells) const {
  const double factor = std::exp(deviations * log_length_deviation_);
  const auto drawn = [&](double pixels) {
    if (random == nullptr) return pixels;
    return static_cast<double>(std::poisson_distribution<int32_t>(pixels)(*random));
  };
  std::map<uint64_t, double> pixels_of_length;
  RareHits hits;
  for (const Place& stretch : stretches_) {
    const uint64_t count = samples[stretch.cell];
    const auto [known, is_new] = pixels_of_length.try_emplace(count, 0);
    if (is_new) known->second = OneHitPixels(count);
    AddHits(stretch, count, drawn(factor * known->second * stretch_px_), &hits, cells);
  }
  for (const Pixel& pixel : pixels_) {
    const uint64_t count = samples[pixel.place.cell];
    const double of_replicate = static_cast<double>(count) / kReplicateCount;
    AddHits(pixel.place, count, drawn(factor * OneHit(pixel.fraction, of_replicate)), &hits, cells);
  }
  hits.AddVariances(cells);
}

}  // namespace sheaf::coordinator
