// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Inversion of pixel filters: closed forms for box and triangle, tables for the others.
#include "worker/render/sampling/filter.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/scene/filter_value.h"

namespace sheaf::render {
namespace {

// The error of a linear piece falls with the square of this: far below the resolution of a pixel.
constexpr int kIntervalCount = 512;

}  // namespace

absl::StatusOr<PixelFilter> PixelFilter::Make(const SceneDescription& scene) {
  const FilterDescription& description = scene.filter;
  const auto fail = [&](const std::string& what) {
    return absl::InvalidArgumentError(
        absl::StrCat(FormatLocation(scene, description.location), ": PixelFilter: ", what));
  };
  PixelFilter filter;
  filter.kind_ = description.kind;
  filter.radius_x_px_ = description.radius_x_px;
  filter.radius_y_px_ = description.radius_y_px;
  if (!(filter.radius_x_px_ > 0) || !(filter.radius_y_px_ > 0) ||
      !std::isfinite(filter.radius_x_px_ + filter.radius_y_px_)) {
    return fail("its radius must be above 0");
  }
  if (description.kind == FilterDescription::Kind::kBox ||
      description.kind == FilterDescription::Kind::kTriangle) {
    return filter;
  }
  if (description.kind == FilterDescription::Kind::kGaussian && !(description.sigma > 0)) {
    return fail("\"float sigma\" must be above 0");
  }
  if (description.kind == FilterDescription::Kind::kSinc && !(description.tau > 0)) {
    return fail("\"float tau\" must be above 0");
  }
  for (Table* table : {&filter.table_x_, &filter.table_y_}) {
    const double radius = table == &filter.table_x_ ? filter.radius_x_px_ : filter.radius_y_px_;
    table->cdf.push_back(0);
    double sum = 0, signed_sum = 0;
    std::vector<double> running{0};
    for (int i = 0; i <= kIntervalCount; ++i) {
      const double x = static_cast<double>(i) / kIntervalCount;
      const double value = FilterValue(description, x, radius);
      table->value.push_back(static_cast<float>(value));
      if (i == 0) continue;
      const double before = table->value[i - 1], after = table->value[i];
      sum += 0.5 * (std::fabs(before) + std::fabs(after));
      signed_sum += 0.5 * (before + after);
      running.push_back(sum);
    }
    if (!(signed_sum > 0)) return fail("its integral is not positive");
    table->weight = static_cast<float>(sum / signed_sum);
    table->inverse_integral = kIntervalCount / (2 * signed_sum);
    table->cdf.clear();
    for (const double r : running) table->cdf.push_back(static_cast<float>(r / sum));
    table->cdf.back() = 1;
    uint16_t interval = 0;
    for (int i = 0; i < kIntervalCount; ++i) {
      while (table->cdf[interval + 1] <= static_cast<float>(i) / kIntervalCount) ++interval;
      table->guide.push_back(interval);
    }
  }
  return filter;
}

PixelFilter::AxisSample PixelFilter::SampleTable(const Table& table, float u) {
  // One number gives both the sign and the distance from the center.
  const float s = 2 * u - 1;
  const float v = std::fabs(s);
  size_t i =
      table.guide[std::min(static_cast<size_t>(v * kIntervalCount), size_t{kIntervalCount - 1})];
  while (i + 1 < kIntervalCount && table.cdf[i + 1] <= v) ++i;
  // The density is linear within the interval: inverts its quadratic in the form that is stable
  // where the slope vanishes.
  const float a = std::fabs(table.value[i]), b = std::fabs(table.value[i + 1]);
  const float width = table.cdf[i + 1] - table.cdf[i];
  const float w = width > 0 ? std::clamp((v - table.cdf[i]) / width, 0.0f, 1.0f) : 0.5f;
  const float root = std::sqrt(a * a + w * (b * b - a * a));
  const float fraction = a + root > 0 ? std::min(1.0f, w * (a + b) / (a + root)) : w;
  const float x = (static_cast<float>(i) + fraction) * (1.0f / kIntervalCount);
  const float value = table.value[i] + fraction * (table.value[i + 1] - table.value[i]);
  return {std::copysign(x, s), value < 0 ? -table.weight : table.weight};
}

PixelFilter::AxisSample PixelFilter::SampleAxis(float u) const {
  const float s = 2 * u - 1;
  if (kind_ == FilterDescription::Kind::kBox) return {s, 1};
  const float v = std::fabs(s);
  // 1 - sqrt(1 - v) without cancellation.
  return {std::copysign(v / (1 + std::sqrt(1 - v)), s), 1};
}

double PixelFilter::EvaluateAxis(const Table& table, double x) const {
  const double distance = std::fabs(x);
  if (kind_ == FilterDescription::Kind::kBox) return x >= -1 && x < 1 ? 0.5 : 0;
  if (!(distance < 1)) return 0;
  if (kind_ == FilterDescription::Kind::kTriangle) return 1 - distance;
  const double position = distance * kIntervalCount;
  const auto i = static_cast<size_t>(position);
  const double before{table.value[i]}, after{table.value[i + 1]};
  return (before + (position - static_cast<double>(i)) * (after - before)) * table.inverse_integral;
}

double PixelFilter::EvaluateX(double offset) const {
  const auto radius = static_cast<double>(radius_x_px_);
  return EvaluateAxis(table_x_, offset / radius) / radius;
}

double PixelFilter::EvaluateY(double offset) const {
  const auto radius = static_cast<double>(radius_y_px_);
  return EvaluateAxis(table_y_, offset / radius) / radius;
}

double PixelFilter::SamplesOnAxis(const Table& table, double radius, double x,
                                  int32_t size_px) const {
  if (!(x > -radius && x < size_px + radius)) return 0;
  const auto first = static_cast<int32_t>(std::max(0.0, std::ceil(x - radius - 0.5)));
  const auto last =
      static_cast<int32_t>(std::min<double>(size_px - 1, std::floor(x + radius - 0.5)));
  double sum = 0;
  for (int32_t pixel = first; pixel <= last; ++pixel) {
    sum += std::fabs(EvaluateAxis(table, (x - (pixel + 0.5)) / radius));
  }
  return sum / (radius * static_cast<double>(table.weight));
}

double PixelFilter::SamplesAt(Vec2d film, int32_t width_px, int32_t height_px) const {
  const Vec2d radius = radius_px();
  return SamplesOnAxis(table_x_, radius.x, film.x, width_px) *
         SamplesOnAxis(table_y_, radius.y, film.y, height_px);
}

FilterSample PixelFilter::Sample(Vec2f u) const {
  const bool tabulated =
      kind_ != FilterDescription::Kind::kBox && kind_ != FilterDescription::Kind::kTriangle;
  const AxisSample x = tabulated ? SampleTable(table_x_, u.x) : SampleAxis(u.x);
  const AxisSample y = tabulated ? SampleTable(table_y_, u.y) : SampleAxis(u.y);
  return {{x.x * radius_x_px_, y.x * radius_y_px_}, x.weight * y.weight};
}

}  // namespace sheaf::render
