// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/environment_map.h"

#include <sys/mman.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/math/elementary.h"
#include "worker/render/equal_area_map.h"

namespace sheaf::render {
namespace {

// A large array that is read here and there would wait for address translation at most reads.
// Only a wish: where the system has no large pages to give, small ones serve. For memory that has
// not been touched.
void WishForLargePages(void* begin, size_t size_bytes) {
#ifdef MADV_HUGEPAGE
  const uintptr_t page = 4096;
  const uintptr_t first = (reinterpret_cast<uintptr_t>(begin) + page - 1) / page * page;
  const uintptr_t end = (reinterpret_cast<uintptr_t>(begin) + size_bytes) / page * page;
  if (first < end) madvise(reinterpret_cast<void*>(first), end - first, MADV_HUGEPAGE);
#endif
}

constexpr double kOneBelowOne = 1 - 0x1p-53;

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

// A coordinate pair up to half a map outside it, moved likewise.
Vec2d WrapOctahedral(Vec2d p, int size) {
  const auto mirror = [size](double* across, double* along) {
    if (*across >= -0.5 && *across <= size - 0.5) return;
    *across = (*across < 0 ? -1 : 2 * size - 1) - *across;
    *along = size - 1 - *along;
  };
  mirror(&p.x, &p.y);
  mirror(&p.y, &p.x);
  return p;
}

// Picks by weight, never one of weight 0. u: in [0, 1), becomes the place within what is picked.
// Requires: a weight is positive.
size_t PickOfFour(const std::array<double, 4>& weights, double* u) {
  const double target = *u * (weights[0] + weights[1] + weights[2] + weights[3]);
  size_t picked = 0;
  double begin = 0, sum = 0;
  for (size_t i = 0; i < 4; ++i) {
    if (weights[i] > 0 && sum <= target) {
      picked = i;
      begin = sum;
    }
    sum += weights[i];
  }
  *u = std::min((target - begin) / weights[picked], kOneBelowOne);
  return picked;
}

size_t PickOf(const DiscreteDistribution& distribution, double* u) {
  const size_t picked = distribution.Sample(*u);
  *u = std::min((*u - distribution.Begin(picked)) / distribution.Probability(picked), kOneBelowOne);
  return picked;
}

// In [-1, 1] with the density 1 - |x|.
double SampleTent(double u) { return u < 0.5 ? std::sqrt(2 * u) - 1 : 1 - std::sqrt(2 * (1 - u)); }

}  // namespace

EnvironmentMap::Cell EnvironmentMap::PickCell(const Grid& weights, double* ux, double* uy) {
  std::array<std::array<double, 4>, 4> rows;
  std::array<double, 4> sums;
  for (size_t y = 0; y < 4; ++y) {
    for (size_t x = 0; x < 4; ++x) rows[y][x] = static_cast<double>(weights[4 * y + x]);
    sums[y] = rows[y][0] + rows[y][1] + rows[y][2] + rows[y][3];
  }
  const size_t y = PickOfFour(sums, uy);
  return {PickOfFour(rows[y], ux), y};
}

EnvironmentMap::Grid EnvironmentMap::TexelWeights(size_t tile_index) const {
  Grid weights;
  for (size_t y = 0; y < kTileSize; ++y) {
    const TexelRow& row = rows_of_tiles_[tile_index + y];
    for (size_t x = 0; x < kTileSize; ++x) weights[kTileSize * y + x] = row.texels[x].rgbl[3];
  }
  return weights;
}

absl::StatusOr<EnvironmentMap> EnvironmentMap::Make(int size, const std::vector<Rgb>& texels) {
  EnvironmentMap map;
  map.size_ = size;
  map.blocks_across_ = static_cast<size_t>((size + kBlockSize - 1) / kBlockSize);
  map.blocks_.resize(map.blocks_across_ * map.blocks_across_);
  const size_t row_count = map.blocks_.size() * kBlockSize * (kBlockSize / kTileSize);
  map.rows_of_tiles_.reserve(row_count);
  WishForLargePages(map.rows_of_tiles_.data(), row_count * sizeof(TexelRow));
  map.rows_of_tiles_.resize(row_count);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const Rgb texel =
          texels[static_cast<size_t>(y) * static_cast<size_t>(size) + static_cast<size_t>(x)];
      if (!IsUsable(texel)) {
        return absl::InvalidArgumentError(
            absl::StrCat("texel (", x, ", ", y, ") is (", texel.r, ", ", texel.g, ", ", texel.b,
                         "), but radiance must be finite and not negative; repair the image"));
      }
      const auto ux = static_cast<size_t>(x), uy = static_cast<size_t>(y);
      map.rows_of_tiles_[map.TileIndex(ux, uy) + uy % kTileSize].texels[ux % kTileSize].rgbl = {
          texel.r, texel.g, texel.b, Luminance(texel)};
    }
  }
  map.BuildDistribution();
  return map;
}

void EnvironmentMap::BuildDistribution() {
  std::vector<double> row_sums(blocks_across_), sums(blocks_across_);
  block_columns_.reserve(blocks_across_);
  double total = 0;
  for (size_t row = 0; row < blocks_across_; ++row) {
    for (size_t i = 0; i < blocks_across_; ++i) {
      const size_t block = row * blocks_across_ + i;
      sums[i] = 0;
      for (size_t tile = 0; tile < 16; ++tile) {
        double sum = 0;
        for (const float weight : TexelWeights((block * 16 + tile) * kTileSize)) {
          sum += static_cast<double>(weight);
        }
        total += sum;
        // A mean, as the sum of floats need not be one.
        const auto mean = static_cast<float>(sum / 16);
        blocks_[block].tile_means[tile] = mean;
        sums[i] += static_cast<double>(mean);
      }
      row_sums[row] += sums[i];
    }
    block_columns_.emplace_back(sums);
  }
  block_rows_ = DiscreteDistribution(row_sums);
  if (block_rows_.empty()) return;
  mean_luminance_ = total / (static_cast<double>(size_) * static_cast<double>(size_));
  pdf_per_luminance_ = 1 / (4 * kPi * mean_luminance_);
}

Rgb EnvironmentMap::Bilinear(double x, double y) const {
  // Also for NaN, which then goes through to the radiance.
  const auto texel_below = [&](double v) {
    return v > -1 ? static_cast<int>(std::floor(std::min(v, size_ - 0.5))) : -1;
  };
  const int x0 = texel_below(x), y0 = texel_below(y);
  const float fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
  const bool is_inside = x0 >= 0 && y0 >= 0 && x0 + 1 < size_ && y0 + 1 < size_;
  const auto texel = [&](int tx, int ty) -> const std::array<float, 4>& {
    if (is_inside) return At(tx, ty).rgbl;
    const auto [wx, wy] = WrapOctahedral(tx, ty, size_);
    return At(wx, wy).rgbl;
  };
  const std::array<float, 4>&p00 = texel(x0, y0), &p10 = texel(x0 + 1, y0);
  const std::array<float, 4>&p01 = texel(x0, y0 + 1), &p11 = texel(x0 + 1, y0 + 1);
  std::array<float, 4> sum;
  for (size_t i = 0; i < 4; ++i) {
    const float upper = (1 - fx) * p00[i] + fx * p10[i];
    const float lower = (1 - fx) * p01[i] + fx * p11[i];
    sum[i] = (1 - fy) * upper + fy * lower;
  }
  return {sum[0], sum[1], sum[2]};
}

void EnvironmentMap::Prefetch(Vec2d p) const {
  if (!(p.x >= 0 && p.y >= 0 && p.x < size_ - 1 && p.y < size_ - 1)) return;
  const int x = static_cast<int>(p.x), y = static_cast<int>(p.y);
  __builtin_prefetch(&At(x, y));
  __builtin_prefetch(&At(x, y + 1));
  __builtin_prefetch(&At(x + 1, y));
  __builtin_prefetch(&At(x + 1, y + 1));
}

Vec2d EnvironmentMap::TexelCoordinates(Vec2f st) const {
  return {static_cast<double>(st.x) * size_ - 0.5, static_cast<double>(st.y) * size_ - 0.5};
}

EnvironmentMap::Place EnvironmentMap::Locate(Vec3f d) const {
  const Place place{EqualAreaSphereToSquare(d)};
  Prefetch(TexelCoordinates(place.st));
  return place;
}

Rgb EnvironmentMap::Radiance(Place place) const {
  const Vec2d p = TexelCoordinates(place.st);
  return Bilinear(p.x, p.y);
}

EnvironmentMap::TileChoice EnvironmentMap::ChooseTile(Vec2f u) const {
  TileChoice choice;
  choice.ux = ExtendBits(u.x, ~SaltOf(u));
  choice.uy = ExtendBits(u.y, SaltOf(u));
  const size_t block_y = PickOf(block_rows_, &choice.uy);
  const size_t block_x = PickOf(block_columns_[block_y], &choice.ux);
  const Cell tile =
      PickCell(blocks_[block_y * blocks_across_ + block_x].tile_means, &choice.ux, &choice.uy);
  choice.x = block_x * kBlockSize + tile.x * kTileSize;
  choice.y = block_y * kBlockSize + tile.y * kTileSize;
  const TexelRow* rows = &rows_of_tiles_[TileIndex(choice.x, choice.y)];
  for (size_t row = 0; row < kTileSize; ++row) __builtin_prefetch(rows + row);
  return choice;
}

Vec3d EnvironmentMap::SampleIn(TileChoice choice) const {
  const Cell texel = PickCell(TexelWeights(TileIndex(choice.x, choice.y)), &choice.ux, &choice.uy);
  const Vec2d p =
      WrapOctahedral(Vec2d{static_cast<double>(choice.x + texel.x) + SampleTent(choice.ux),
                           static_cast<double>(choice.y + texel.y) + SampleTent(choice.uy)},
                     size_);
  Prefetch(p);  // Who samples a direction asks for its radiance.
  const double scale = 1.0 / size_;
  return EqualAreaSquareToSphere({(p.x + 0.5) * scale, (p.y + 0.5) * scale});
}

double EnvironmentMap::PbrtIlluminance() const {
  double sum = 0;
  for (int y = 0; y < size_; ++y) {
    for (int x = 0; x < size_; ++x) {
      const Vec3d d = EqualAreaSquareToSphere({(x + 0.5) / size_, (y + 0.5) / size_});
      if (d.z > 0) sum += static_cast<double>(At(x, y).rgbl[3]) * d.z;
    }
  }
  return 2 * kPi * sum / (static_cast<double>(size_) * static_cast<double>(size_));
}

size_t EnvironmentMap::size_bytes() const {
  size_t bytes = rows_of_tiles_.size() * sizeof(TexelRow) + blocks_.size() * sizeof(BlockWeights) +
                 block_rows_.size_bytes();
  for (const DiscreteDistribution& row : block_columns_) bytes += row.size_bytes();
  return bytes;
}

}  // namespace sheaf::render
