// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/sampling/warp_table.h"

#include <algorithm>
#include <cmath>

namespace sheaf::render {
namespace {

// Integral from 0 to x of the linear function that runs from a to b over [0, 1].
float LinearCdf(float a, float b, float x) { return x * (a + 0.5f * x * (b - a)); }

// Returns the x in [0, 1] up to which the linear function from a >= 0 to b >= 0 has integral c.
// This form of the quadratic's root has no cancellation, and no special case for equal a and b.
float InvertLinearCdf(float a, float b, float c) {
  const float root = std::sqrt(std::fmax(a * a + 2 * c * (b - a), 0.0f));
  const float divisor = a + root;
  return divisor > 0 ? std::clamp(2 * c / divisor, 0.0f, 1.0f) : 0;
}

float Lerp(float t, float a, float b) { return (1 - t) * a + t * b; }

// Returns the last of 0 ... count - 1 with f(i) <= value for nondecreasing f; 0 if there is none.
template <typename Function>
uint32_t FindStep(uint32_t count, float value, const Function& f) {
  uint32_t low = 0, high = count;
  while (high - low > 1) {
    const uint32_t middle = low + (high - low) / 2;
    (f(middle) <= value ? low : high) = middle;
  }
  return low;
}

}  // namespace

AxisPosition FindOnAxis(const std::vector<float>& axis, float value) {
  if (axis.size() < 2 || !(value > axis.front())) return {0, 0};
  const auto last = static_cast<uint32_t>(axis.size() - 1);
  if (value >= axis.back()) return {last, 0};
  const uint32_t i = FindStep(last, value, [&](uint32_t k) { return axis[k]; });
  return {i, (value - axis[i]) / (axis[i + 1] - axis[i])};
}

SliceBlend BlendSlices(const std::vector<float>& phi_axis, const std::vector<float>& theta_axis,
                       float phi, float theta) {
  const AxisPosition p = FindOnAxis(phi_axis, phi), t = FindOnAxis(theta_axis, theta);
  const auto theta_count = static_cast<uint32_t>(theta_axis.size());
  SliceBlend blend;
  for (uint32_t i = 0; i < 2; ++i) {
    const float phi_weight = i == 0 ? 1 - p.fraction : p.fraction;
    for (uint32_t j = 0; j < 2; ++j) {
      const float weight = phi_weight * (j == 0 ? 1 - t.fraction : t.fraction);
      if (!(weight > 0)) continue;
      blend.slice[blend.count] = (p.index + i) * theta_count + t.index + j;
      blend.weight[blend.count++] = weight;
    }
  }
  return blend;
}

CellPosition FindCell(uint32_t width, uint32_t height, Vec2f p) {
  const auto along = [](uint32_t count, float x, float* fraction) {
    const float scaled = std::fmin(std::fmax(x, 0.0f), 1.0f) * static_cast<float>(count - 1);
    const uint32_t cell = std::min(static_cast<uint32_t>(scaled), count - 2);
    *fraction = scaled - static_cast<float>(cell);
    return cell;
  };
  CellPosition cell;
  cell.column = along(width, p.x, &cell.at.x);
  cell.row = along(height, p.y, &cell.at.y);
  return cell;
}

float BilinearGrid::At(Vec2f p) const {
  const CellPosition cell = FindCell(width_, height_, p);
  const float* v = &values_[static_cast<size_t>(cell.row) * width_ + cell.column];
  return Lerp(cell.at.y, Lerp(cell.at.x, v[0], v[1]), Lerp(cell.at.x, v[width_], v[width_ + 1]));
}

WarpTable::WarpTable(uint32_t width, uint32_t height, std::vector<float> densities)
    : width_(width), height_(height), values_(std::move(densities)) {
  const size_t per_slice = static_cast<size_t>(width) * height;
  line_sums_.resize(values_.size());
  row_sums_.resize(values_.size() / width);
  for (size_t begin = 0; begin < values_.size(); begin += per_slice) {
    float* values = &values_[begin];
    // In double, so that sums in another order agree.
    double total = 0;
    std::vector<double> lines(per_slice), rows(height, 0.0);
    const auto sum = [&] {
      for (size_t y = 0; y < height; ++y) {
        double line = 0;
        for (size_t x = 0; x < width; ++x) {
          const size_t i = y * width + x;
          if (x > 0)
            line += 0.5 * (static_cast<double>(values[i - 1]) + static_cast<double>(values[i]));
          lines[i] = line;
        }
        if (y > 0) rows[y] = rows[y - 1] + 0.5 * (lines[y * width - 1] + line);
      }
      total = rows[height - 1];
    };
    sum();
    if (!(total > 0)) {
      std::fill_n(values, per_slice, 1.0f);
      sum();
    }
    for (size_t i = 0; i < per_slice; ++i) {
      values[i] = static_cast<float>(static_cast<double>(values[i]) / total);
      line_sums_[begin + i] = static_cast<float>(lines[i] / total);
    }
    for (size_t y = 0; y < height; ++y) {
      row_sums_[begin / width + y] = static_cast<float>(rows[y] / total);
    }
  }
}

float WarpTable::Blend(const SliceBlend& blend, const std::vector<float>& table, size_t per_slice,
                       size_t index) const {
  float sum = 0;
  for (size_t k = 0; k < blend.count; ++k) {
    sum += blend.weight[k] * table[blend.slice[k] * per_slice + index];
  }
  return sum;
}

WarpTable::Row WarpTable::RowAt(const SliceBlend& blend, uint32_t row) const {
  const size_t per_slice = static_cast<size_t>(width_) * height_;
  const size_t end = static_cast<size_t>(row) * width_ + width_ - 1;
  return {Blend(blend, line_sums_, per_slice, end),
          Blend(blend, line_sums_, per_slice, end + width_)};
}

float WarpTable::LineSum(const SliceBlend& blend, uint32_t row, float y, uint32_t column) const {
  const size_t per_slice = static_cast<size_t>(width_) * height_;
  const size_t at = static_cast<size_t>(row) * width_ + column;
  return Lerp(y, Blend(blend, line_sums_, per_slice, at),
              Blend(blend, line_sums_, per_slice, at + width_));
}

float WarpTable::LineValue(const SliceBlend& blend, uint32_t row, float y, uint32_t column) const {
  const size_t per_slice = static_cast<size_t>(width_) * height_;
  const size_t at = static_cast<size_t>(row) * width_ + column;
  return Lerp(y, Blend(blend, values_, per_slice, at),
              Blend(blend, values_, per_slice, at + width_));
}

WarpTable::Point WarpTable::Sample(const SliceBlend& blend, Vec2f u) const {
  const auto row_sum = [&](uint32_t row) { return Blend(blend, row_sums_, height_, row); };
  const uint32_t row = FindStep(height_ - 1, u.y, row_sum);
  const Row r = RowAt(blend, row);
  const float y = InvertLinearCdf(r.below, r.above, u.y - row_sum(row));
  const float target = u.x * Lerp(y, r.below, r.above);
  const auto line_sum = [&](uint32_t column) { return LineSum(blend, row, y, column); };
  const uint32_t column = FindStep(width_ - 1, target, line_sum);
  const float left = LineValue(blend, row, y, column), right = LineValue(blend, row, y, column + 1);
  const float x = InvertLinearCdf(left, right, target - line_sum(column));
  const auto columns = static_cast<float>(width_ - 1), rows = static_cast<float>(height_ - 1);
  return {{(static_cast<float>(column) + x) / columns, (static_cast<float>(row) + y) / rows},
          Lerp(x, left, right) * columns * rows};
}

WarpTable::Point WarpTable::Invert(const SliceBlend& blend, Vec2f p) const {
  const CellPosition cell = FindCell(width_, height_, p);
  const Row r = RowAt(blend, cell.row);
  const float left = LineValue(blend, cell.row, cell.at.y, cell.column);
  const float right = LineValue(blend, cell.row, cell.at.y, cell.column + 1);
  const float line = Lerp(cell.at.y, r.below, r.above);
  const auto columns = static_cast<float>(width_ - 1), rows = static_cast<float>(height_ - 1);
  const float pdf = Lerp(cell.at.x, left, right) * columns * rows;
  if (!(pdf > 0 && line > 0)) return {};
  const float x =
      (LineSum(blend, cell.row, cell.at.y, cell.column) + LinearCdf(left, right, cell.at.x)) / line;
  const float y =
      Blend(blend, row_sums_, height_, cell.row) + LinearCdf(r.below, r.above, cell.at.y);
  return {{std::clamp(x, 0.0f, 1.0f), std::clamp(y, 0.0f, 1.0f)}, pdf};
}

float WarpTable::Pdf(const SliceBlend& blend, Vec2f p) const {
  const CellPosition cell = FindCell(width_, height_, p);
  return Lerp(cell.at.x, LineValue(blend, cell.row, cell.at.y, cell.column),
              LineValue(blend, cell.row, cell.at.y, cell.column + 1)) *
         static_cast<float>(width_ - 1) * static_cast<float>(height_ - 1);
}

}  // namespace sheaf::render
