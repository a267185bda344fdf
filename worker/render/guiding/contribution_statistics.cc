// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/contribution_statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "common/base/check.h"
#include "common/base/vector_bytes.h"
#include "common/math/elementary.h"
#include "worker/render/guiding/guiding_statistics.h"

namespace sheaf::render {
namespace {

// 0 for light beyond the range of float.
float FactorOf(double factor) {
  return factor <= static_cast<double>(std::numeric_limits<float>::max())
             ? static_cast<float>(factor)
             : 0;
}

}  // namespace

ContributionGrid ContributionGridFor(int32_t width_px, int32_t height_px, uint64_t paths) {
  ContributionGrid grid{width_px, height_px, kContributionBlockBitsMin};
  while (grid.size() > 1 && grid.block_bits < kContributionBlockBitsMax &&
         (grid.size() > kContributionBlocksMax || grid.size() > paths / kContributionBlockPaths)) {
    ++grid.block_bits;
  }
  return grid;
}

ContributionStatistics::ContributionStatistics(uint32_t region_count, const ContributionGrid& grid,
                                               int unit_exponent)
    : units_per_value_(elementary::PowerOfTwo(-unit_exponent)),
      value_of_unit_(elementary::PowerOfTwo(unit_exponent)),
      grid_(grid),
      regions_(region_count),
      blocks_(grid.size()) {
  SHEAF_CHECK(std::abs(unit_exponent) <= kGuidingUnitExponentMax);
  SHEAF_CHECK(region_count <= kGuidingRegionsMax && grid.size() > 0 &&
              grid.size() <= kContributionBlocksMax);
}

void ContributionStatistics::Add(double value, uint64_t rays, Sums* sums) const {
  const auto add = [](uint64_t v, std::atomic<uint64_t>* sum) {
    sum->fetch_add(v, std::memory_order_relaxed);
  };
  add(1, &sums->number);
  add(std::min(rays, kContributionRaysMax), &sums->rays);
  const double units = std::isfinite(value) ? value * units_per_value_ : 0;
  if (!(units >= 0.5)) return;  // Rounds to 0.
  add(static_cast<uint64_t>(std::min(units, kContributionValueMax) + 0.5), &sums->values);
  const double root = units / kContributionSquareUnit;
  add(static_cast<uint64_t>(std::min(root * root, kContributionSquareMax) + 0.5), &sums->squares);
}

void ContributionStatistics::AddVertex(uint32_t region, double scattered, uint64_t rays) {
  Add(scattered, rays, &regions_[region]);
}

void ContributionStatistics::AddPath(int32_t x, int32_t y, double radiance, uint64_t rays) {
  Add(radiance, rays, &blocks_[grid_.BlockOf(x, y)]);
}

ContributionStatistics::Means ContributionStatistics::MeansOf(const Sums& sums) const {
  Means means;
  means.number = static_cast<double>(sums.number.load(std::memory_order_relaxed));
  if (!(means.number > 0)) return means;
  const auto mean_of = [&](const std::atomic<uint64_t>& sum) {
    return static_cast<double>(sum.load(std::memory_order_relaxed)) / means.number;
  };
  means.value = mean_of(sums.values);
  means.square = mean_of(sums.squares) * kContributionSquareUnit * kContributionSquareUnit;
  means.rays = mean_of(sums.rays);
  return means;
}

std::vector<double> ContributionStatistics::BlurredImage(const std::vector<Means>& blocks) const {
  const size_t columns = grid_.columns(), rows = grid_.rows();
  std::vector<double> image(blocks.size());
  for (size_t y = 0; y < rows; ++y) {
    for (size_t x = 0; x < columns; ++x) {
      double sum = 0, weight = 0;
      for (size_t v = y > 0 ? y - 1 : 0; v < std::min(y + 2, rows); ++v) {
        for (size_t u = x > 0 ? x - 1 : 0; u < std::min(x + 2, columns); ++u) {
          const Means& block = blocks[v * columns + u];
          const double w = block.number * (u == x ? 2 : 1) * (v == y ? 2 : 1);
          sum += w * block.value;
          weight += w;
        }
      }
      image[y * columns + x] = weight > 0 ? sum / weight : 0;
    }
  }
  return image;
}

// In units.
void ContributionStatistics::SetBlocks(ContributionField* field) const {
  std::vector<Means> blocks;
  double number = 0, light = 0, rays = 0;
  for (const Sums& sums : blocks_) {
    const Means means = MeansOf(sums);
    number += means.number;
    light += means.number * means.value;
    rays += means.number * means.rays;
    blocks.push_back(means);
  }
  if (!(light > 0)) return;
  const double dark = kContributionDark * light / number;
  std::vector<double> pixels = BlurredImage(blocks);
  double variance = 0;
  for (size_t i = 0; i < blocks.size(); ++i) {
    pixels[i] = std::sqrt(pixels[i] * pixels[i] + dark * dark);
    const double absolute = std::max(0.0, blocks[i].square - blocks[i].value * blocks[i].value);
    variance += blocks[i].number * absolute / (pixels[i] * pixels[i]);
  }
  // Where samples do not vary, nothing is split.
  const double scale = variance > 0 ? kContributionEagerness * std::sqrt(rays / variance) : 0;
  for (const double pixel : pixels) {
    field->blocks_.push_back(FactorOf(scale / (pixel * value_of_unit_)));
  }
}

void ContributionStatistics::SetRegions(ContributionField* field) const {
  double squares = 0, squared_means = 0;
  for (const Sums& sums : regions_) {
    const Means means = MeansOf(sums);
    squares += means.number * means.square;
    squared_means += means.number * means.value * means.value;
  }
  const double ratio_of_all = squared_means > 0 ? squares / squared_means : 0;
  for (const Sums& sums : regions_) {
    const Means means = MeansOf(sums);
    const double squared_mean = means.value * means.value;
    const double square =
        (means.number * means.square + kContributionPriorValues * ratio_of_all * squared_mean) /
        (means.number + kContributionPriorValues);
    const double variance = std::max(0.0, square - squared_mean);
    field->regions_.push_back(
        FactorOf(std::sqrt(variance / std::max(1.0, means.rays)) * value_of_unit_));
  }
}

ContributionField ContributionStatistics::Freeze() const {
  ContributionField field;
  SetBlocks(&field);
  if (field.blocks_.empty()) return {};
  field.grid_ = grid_;
  SetRegions(&field);
  return field;
}

uint64_t ContributionStatistics::memory_bytes() const {
  return sizeof(*this) + VectorBytes(regions_, blocks_);
}

}  // namespace sheaf::render
