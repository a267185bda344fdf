// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/zoomed_pilots.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/scene/filter_value.h"
#include "coordinator/forecast/emitter_colors.h"

namespace sheaf::coordinator {
namespace {

// Pixels of a zoomed pilot show the emitter if they have at least this fraction of the brightest
// pixel's value.
constexpr double kEmitterFraction = 0.5;
// Minimum number of pixels of a zoomed pilot across the bounds of an emitter, unless this exceeds
// kZoomedPilotScaleMax.
constexpr int32_t kAcrossPx = 16;

// The pixels of the frame whose center is within the filter's radius of a point.
PixelRect ReachOf(double x, double y, const FilterDescription& filter) {
  const auto first = [](double from) { return static_cast<int32_t>(std::ceil(from - 0.5)); };
  const auto rx = static_cast<double>(filter.radius_x_px);
  const auto ry = static_cast<double>(filter.radius_y_px);
  return {first(x - rx), first(y - ry), first(x + rx), first(y + ry)};
}

double WeightAt(const FilterDescription& filter, double x_px, double y_px) {
  const auto rx = static_cast<double>(filter.radius_x_px);
  const auto ry = static_cast<double>(filter.radius_y_px);
  return std::fabs(FilterValue(filter, std::fabs(x_px) / rx, rx) *
                   FilterValue(filter, std::fabs(y_px) / ry, ry));
}

// The filter's sum over all points of a zoomed pilot's grid that it reaches.
double WeightSum(const FilterDescription& filter, int32_t scale) {
  const auto count = [&](float radius_px) {
    return static_cast<int32_t>(std::ceil(radius_px)) * scale;
  };
  double sum = 0;
  for (int32_t j = -count(filter.radius_y_px); j < count(filter.radius_y_px); ++j) {
    for (int32_t i = -count(filter.radius_x_px); i < count(filter.radius_x_px); ++i) {
      const double x = (i + 0.5) / scale, y = (j + 0.5) / scale;
      if (std::fabs(x) > static_cast<double>(filter.radius_x_px) ||
          std::fabs(y) > static_cast<double>(filter.radius_y_px)) {
        continue;
      }
      sum += WeightAt(filter, x, y);
    }
  }
  return sum;
}

}  // namespace

std::vector<ZoomedRegion> ChooseZoomedRegions(std::span<const PixelRect> emitters,
                                              const PixelRect& window, double emitter_px_max,
                                              double samples_max) {
  std::vector<ZoomedRegion> places;
  for (const PixelRect& emitter : emitters) {
    const int32_t across_px = std::min(emitter.Width(), emitter.Height());
    if (across_px > emitter_px_max) continue;
    const PixelRect rect =
        Intersect({emitter.x0 - 1, emitter.y0 - 1, emitter.x1 + 1, emitter.y1 + 1}, window);
    if (rect.IsEmpty()) continue;
    places.push_back({rect, std::clamp(kAcrossPx / across_px, 1, kZoomedPilotScaleMax)});
  }
  std::ranges::stable_sort(places, {}, &ZoomedRegion::SampleCount);
  std::vector<ZoomedRegion> chosen;
  double samples = 0;
  for (const ZoomedRegion& place : places) {
    // An image that is chosen already may include this emitter.
    const bool is_seen = std::ranges::any_of(chosen, [&](const ZoomedRegion& other) {
      return !Intersect(place.rect, other.rect).IsEmpty();
    });
    if (is_seen) continue;
    samples += place.SampleCount();
    if (samples > samples_max || chosen.size() == kZoomedPilotsMax) break;
    chosen.push_back(place);
  }
  return chosen;
}

std::vector<EmitterPixel> EmitterPixelsOf(const ZoomedPilot& zoomed_pilot,
                                          const FilterDescription& filter,
                                          const PixelRect& window) {
  const EmitterColors seen(zoomed_pilot.image);
  const PixelRect& grid = seen.window();
  const int32_t scale = zoomed_pilot.place.scale;
  double brightest = 0;
  const auto for_each = [&](const auto& act) {
    for (int32_t y = grid.y0; y < grid.y1; ++y) {
      for (int32_t x = grid.x0; x < grid.x1; ++x) act(x, y);
    }
  };
  for_each([&](int32_t x, int32_t y) {
    brightest = std::max(brightest, std::ranges::max(seen.Seen(x, y)));
  });
  if (brightest == 0) return {};
  std::array<double, 3> emitter{}, beside{};
  double emitter_count = 0, beside_count = 0;
  std::map<std::pair<int32_t, int32_t>, double> weights;  // By y and x.
  for_each([&](int32_t x, int32_t y) {
    const bool is_emitter = std::ranges::max(seen.Seen(x, y)) >= kEmitterFraction * brightest;
    const std::array<double, 3> color = is_emitter ? seen.Seen(x, y) : seen.All(x, y);
    for (size_t i = 0; i < 3; ++i) (is_emitter ? emitter : beside)[i] += color[i];
    (is_emitter ? emitter_count : beside_count) += 1;
    if (!is_emitter) return;
    const double px = (x + 0.5) / scale, py = (y + 0.5) / scale;
    const PixelRect reach = Intersect(ReachOf(px, py, filter), window);
    for (int32_t v = reach.y0; v < reach.y1; ++v) {
      for (int32_t u = reach.x0; u < reach.x1; ++u) {
        weights[{v, u}] += WeightAt(filter, u + 0.5 - px, v + 0.5 - py);
      }
    }
  });
  if (beside_count == 0) return {};
  for (size_t i = 0; i < 3; ++i) {
    emitter[i] /= emitter_count;
    beside[i] /= beside_count;
  }
  const double sum = WeightSum(filter, scale);
  std::vector<EmitterPixel> pixels;
  for (const auto& [place, weight] : weights) {
    if (weight > 0) {
      pixels.push_back({place.second, place.first, std::min(1.0, weight / sum), emitter, beside});
    }
  }
  return pixels;
}

}  // namespace sheaf::coordinator
