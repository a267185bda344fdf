// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/gather/gather_grid.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <set>

#include "common/math/elementary.h"
#include "common/math/mix_bits.h"

namespace sheaf::render {
namespace {

// The exponent of a power of two that is at least the diameter, and at most four times the radius.
int LevelOf(float radius) {
  int exponent = 0;
  std::frexp(radius, &exponent);
  return exponent + 1;
}

bool IsUsable(const GatherBall& ball) {
  return ball.radius > 0 && std::isfinite(ball.radius + ball.p.x + ball.p.y + ball.p.z);
}

}  // namespace

std::array<int64_t, 3> GatherGrid::CellOf(Vec3f p, int level, double shift) {
  // Farther out, cells are finer than the coordinates of floats.
  constexpr double kCoordinateMax = 0x1p60;
  std::array<int64_t, 3> cell;
  for (size_t i = 0; i < 3; ++i) {
    const double at =
        std::floor(static_cast<double>(p[i]) * elementary::PowerOfTwo(-level) - shift);
    cell[i] = static_cast<int64_t>(std::clamp(at, -kCoordinateMax, kCoordinateMax));
  }
  return cell;
}

uint64_t GatherGrid::KeyOf(const std::array<int64_t, 3>& cell, int level) {
  uint64_t key = MixBits(static_cast<uint64_t>(static_cast<int64_t>(level)));
  for (const int64_t coordinate : cell) key = MixBits(key + static_cast<uint64_t>(coordinate));
  return key;
}

void GatherGrid::AddCell(uint64_t key, uint32_t first, uint32_t end) {
  uint64_t at = key & mask_;
  while (cells_[at].first != cells_[at].end) at = (at + 1) & mask_;
  cells_[at] = {key, first, end};
}

void GatherGrid::Build(std::span<const GatherBall> balls) {
  constexpr float kMost = std::numeric_limits<float>::max();
  lower_ = {kMost, kMost, kMost};
  upper_ = {-kMost, -kMost, -kMost};
  order_.clear();
  order_.reserve(balls.size());
  std::set<int> levels;
  for (uint32_t i = 0; i < balls.size(); ++i) {
    const GatherBall& ball = balls[i];
    if (!IsUsable(ball)) continue;
    const int level = LevelOf(ball.radius);
    levels.insert(level);
    order_.push_back({KeyOf(CellOf(ball.p, level, 0), level), i});
    for (size_t k = 0; k < 3; ++k) {
      lower_[k] = std::min(lower_[k], ball.p[k] - ball.radius);
      upper_[k] = std::max(upper_[k], ball.p[k] + ball.radius);
    }
  }
  levels_.assign(levels.begin(), levels.end());
  std::ranges::sort(order_, [](const Place& a, const Place& b) {
    return a.key != b.key ? a.key < b.key : a.ball < b.ball;
  });
  size_t cell_count = 0;
  for (size_t i = 0; i < order_.size(); ++i) {
    cell_count += i == 0 || order_[i].key != order_[i - 1].key;
  }
  cells_.assign(std::bit_ceil(2 * cell_count + 1), {});
  mask_ = cells_.size() - 1;
  entries_.clear();
  entries_.reserve(order_.size());
  for (uint32_t first = 0, i = 0; i < order_.size(); ++i) {
    const GatherBall& ball = balls[order_[i].ball];
    entries_.push_back({ball.p, ball.radius * ball.radius, order_[i].ball});
    if (i + 1 < order_.size() && order_[i + 1].key == order_[i].key) continue;
    AddCell(order_[i].key, first, i + 1);
    first = i + 1;
  }
}

}  // namespace sheaf::render
