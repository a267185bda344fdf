// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/environment_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/math/elementary.h"
#include "worker/render/equal_area_map.h"

namespace sheaf::render {
namespace {

double LuminanceOf(Rgb c) { return static_cast<double>(Luminance(c)); }

bool IsUsable(Rgb c) { return IsFinite(c) && c.r >= 0 && c.g >= 0 && c.b >= 0; }

// Texel coordinates one step outside the map, moved to the texel that is its neighbour on the
// sphere: across an edge the map continues with the same edge mirrored about its middle.
std::pair<int, int> WrapOctahedral(int x, int y, int size) {
  if (x < 0 || x >= size) {
    x = std::clamp(x, 0, size - 1);
    y = size - 1 - y;
  }
  if (y < 0 || y >= size) {
    y = std::clamp(y, 0, size - 1);
    x = size - 1 - x;
  }
  return {x, y};
}

// Where in [0, 1] a density that goes linearly from a to b has put the share u of its mass.
double InvertLinear(double a, double b, double u) {
  const double mean_square = a * a + u * (b - a) * (b + a);
  const double denominator = a + std::sqrt(std::max(mean_square, 0.0));
  return denominator > 0 ? std::clamp(u * (a + b) / denominator, 0.0, 1.0) : u;
}

// The last i in [0, count) with value_at(i) <= target, or 0: by steps that double from a guess,
// then by halving. Cheap where the guess is near, as along a row of even brightness.
template <typename ValueAt>
size_t LastNotAbove(const ValueAt& value_at, double target, size_t count, size_t guess) {
  size_t low = std::min(guess, count - 1), high = low + 1;
  for (size_t step = 1; low > 0 && value_at(low) > target; step *= 2) {
    high = low;
    low -= std::min(low, step);
  }
  for (size_t step = 1; high < count && value_at(high) <= target; step *= 2) {
    low = high;
    high = std::min(high + step, count);
  }
  while (high - low > 1) {
    const size_t middle = (low + high) / 2;
    (value_at(middle) <= target ? low : high) = middle;
  }
  return low;
}

}  // namespace

absl::StatusOr<EnvironmentMap> EnvironmentMap::Make(int size, const std::vector<Rgb>& texels) {
  EnvironmentMap map;
  map.size_ = size;
  map.padded_.resize(static_cast<size_t>(size + 2) * static_cast<size_t>(size + 2));
  for (int y = -1; y <= size; ++y) {
    for (int x = -1; x <= size; ++x) {
      const auto [wx, wy] = WrapOctahedral(x, y, size);
      const Rgb texel =
          texels[static_cast<size_t>(wy) * static_cast<size_t>(size) + static_cast<size_t>(wx)];
      if (!IsUsable(texel)) {
        return absl::InvalidArgumentError(
            absl::StrCat("texel (", wx, ", ", wy, ") is (", texel.r, ", ", texel.g, ", ", texel.b,
                         "), but radiance must be finite and not negative; repair the image"));
      }
      map.padded_[static_cast<size_t>(y + 1) * static_cast<size_t>(size + 2) +
                  static_cast<size_t>(x + 1)] = texel;
    }
  }
  map.BuildDistribution();
  return map;
}

void EnvironmentMap::BuildDistribution() {
  const size_t node_count = static_cast<size_t>(size_) + 2;
  node_position_.resize(node_count);
  for (size_t i = 1; i + 1 < node_count; ++i) node_position_[i] = static_cast<double>(i) - 1;
  node_position_.front() = -0.5;
  node_position_.back() = size_ - 0.5;
  row_sums_.assign(node_count * node_count, 0);
  for (size_t j = 0; j < node_count; ++j) {
    double* sums = &row_sums_[j * node_count];
    double previous = LuminanceOf(Bilinear(node_position_[0], node_position_[j]));
    for (size_t i = 1; i < node_count; ++i) {
      const double next = LuminanceOf(Bilinear(node_position_[i], node_position_[j]));
      const double width = node_position_[i] - node_position_[i - 1];
      sums[i] = sums[i - 1] + 0.5 * width * (previous + next);
      previous = next;
    }
  }
  BuildGuides();
  std::vector<double> strips(node_count - 1);
  double total = 0;
  for (size_t j = 0; j + 1 < node_count; ++j) {
    const double height = node_position_[j + 1] - node_position_[j];
    strips[j] =
        0.5 * height * (row_sums_[(j + 1) * node_count - 1] + row_sums_[(j + 2) * node_count - 1]);
    total += strips[j];
  }
  rows_ = DiscreteDistribution(strips);
  mean_luminance_ = total / (static_cast<double>(size_) * static_cast<double>(size_));
}

void EnvironmentMap::BuildGuides() {
  const size_t node_count = node_position_.size();
  row_totals_.resize(node_count);
  row_guides_.resize(node_count * (kGuideCount + 1));
  for (size_t j = 0; j < node_count; ++j) {
    const double* sums = &row_sums_[j * node_count];
    row_totals_[j] = sums[node_count - 1];
    size_t node = 0;
    for (size_t k = 0; k <= kGuideCount; ++k) {
      const double target = row_totals_[j] * (static_cast<double>(k) / kGuideCount);
      while (node + 2 < node_count && sums[node + 1] <= target) ++node;
      row_guides_[j * (kGuideCount + 1) + k] =
          static_cast<uint16_t>(std::min<size_t>(node, std::numeric_limits<uint16_t>::max()));
    }
  }
}

size_t EnvironmentMap::GuessNode(size_t row, double u) const {
  const double scaled = u * kGuideCount;
  const auto k = std::min(static_cast<size_t>(scaled), kGuideCount - 1);
  const uint16_t* guide = &row_guides_[row * (kGuideCount + 1) + k];
  return static_cast<size_t>(guide[0] + (scaled - static_cast<double>(k)) * (guide[1] - guide[0]));
}

Rgb EnvironmentMap::Bilinear(double x, double y) const {
  // Also for NaN, which then goes through to the radiance.
  const auto texel_below = [&](double v) {
    return v > -1 ? static_cast<int>(std::floor(std::min(v, size_ - 0.5))) : -1;
  };
  const int x0 = texel_below(x), y0 = texel_below(y);
  const float fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
  const Rgb upper = (1 - fx) * Padded(x0, y0) + fx * Padded(x0 + 1, y0);
  const Rgb lower = (1 - fx) * Padded(x0, y0 + 1) + fx * Padded(x0 + 1, y0 + 1);
  return (1 - fy) * upper + fy * lower;
}

Rgb EnvironmentMap::Radiance(Vec3f d) const {
  const Vec2f st = EqualAreaSphereToSquare(d);
  return Bilinear(static_cast<double>(st.x) * size_ - 0.5, static_cast<double>(st.y) * size_ - 0.5);
}

Vec3d EnvironmentMap::Sample(Vec2f u) const {
  const size_t node_count = node_position_.size();
  const double uy = ExtendBits(u.y, SaltOf(u)), ux = ExtendBits(u.x, ~SaltOf(u));
  // The strip, and the height in it: its density is linear between the sums of its two node rows.
  const size_t j = rows_.Sample(uy);
  const double rest = std::clamp((uy - rows_.Begin(j)) / rows_.Probability(j), 0.0, 1.0);
  const double* upper = &row_sums_[j * node_count];
  const double* lower = upper + node_count;
  const double ty = InvertLinear(row_totals_[j], row_totals_[j + 1], rest);
  const size_t guess = GuessNode(j, ux);
  // The texels are wanted once the node is known; most often it is near.
  const size_t stride = node_count;
  __builtin_prefetch(&padded_[j * stride + guess]);
  __builtin_prefetch(&padded_[(j + 1) * stride + guess]);
  // At that height the running integral along x is the blend of those of the two rows.
  const auto sum_at = [&](size_t i) { return (1 - ty) * upper[i] + ty * lower[i]; };
  const double target = ux * ((1 - ty) * row_totals_[j] + ty * row_totals_[j + 1]);
  const size_t low = LastNotAbove(sum_at, target, node_count - 1, guess);
  const double mass = sum_at(low + 1) - sum_at(low);
  const double y = node_position_[j] + ty * (node_position_[j + 1] - node_position_[j]);
  const double x0 = node_position_[low], width = node_position_[low + 1] - x0;
  const double tx =
      InvertLinear(LuminanceOf(Bilinear(x0, y)), LuminanceOf(Bilinear(x0 + width, y)),
                   mass > 0 ? std::clamp((target - sum_at(low)) / mass, 0.0, 1.0) : 0.5);
  const double scale = 1.0 / size_;
  return EqualAreaSquareToSphere({(x0 + tx * width + 0.5) * scale, (y + 0.5) * scale});
}

double EnvironmentMap::Pdf(Rgb radiance) const {
  return LuminanceOf(radiance) / (4 * kPi * mean_luminance_);
}

double EnvironmentMap::PbrtIlluminance() const {
  double sum = 0;
  for (int y = 0; y < size_; ++y) {
    for (int x = 0; x < size_; ++x) {
      const Vec3d d = EqualAreaSquareToSphere({(x + 0.5) / size_, (y + 0.5) / size_});
      if (d.z > 0) sum += LuminanceOf(Padded(x, y)) * d.z;
    }
  }
  return 2 * kPi * sum / (static_cast<double>(size_) * static_cast<double>(size_));
}

size_t EnvironmentMap::size_bytes() const {
  return padded_.size() * sizeof(Rgb) + row_sums_.size() * sizeof(double) +
         row_totals_.size() * sizeof(double) + row_guides_.size() * sizeof(uint16_t) +
         rows_.size_bytes();
}

}  // namespace sheaf::render
