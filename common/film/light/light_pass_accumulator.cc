// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/light/light_pass_accumulator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/base/check.h"
#include "common/film/task_kind.h"
#include "common/math/double_float.h"
#include "common/math/wide_product.h"

namespace sheaf {
namespace {

constexpr std::array kHeads{FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi};
constexpr std::array kTails{FilmChannel::kRedLo, FilmChannel::kGreenLo, FilmChannel::kBlueLo};

// The sums of a pixel with the splat, or none where it cannot be added.
std::optional<std::array<double, 3>> SumWith(const double* sums, const Rgb& value, float weight) {
  std::array<double, 3> with;
  for (size_t i = 0; i < 3; ++i) {
    const double sum = sums[i] + WideProduct(value[i], weight);
    // Also false for NaN.
    if (!(std::fabs(sum) <= static_cast<double>(kSampleMagnitudeMax))) return std::nullopt;
    with[i] = DoubleFloat::Round(sum);
  }
  return with;
}

void MergeInto(const std::vector<double>& left, std::vector<double>* right) {
  for (size_t i = 0; i < left.size(); ++i) {
    (*right)[i] = DoubleFloat::Round(left[i] + (*right)[i]);
  }
}

}  // namespace

LightPassAccumulator::LightPassAccumulator(FilmTile* tile)
    : tile_(tile),
      bias_at_(3 + 3 * tile->outputs().light_groups.size()),
      stride_(bias_at_ + (HasMergeBias(tile->outputs()) ? kMergeBiasMeanCount : 0)) {
  SHEAF_CHECK(tile->block().count <= kPassesMax);
  pass_.assign(stride_ * tile->plane_size(), 0);
}

void LightPassAccumulator::Add(int32_t x, int32_t y, const Rgb& value, float weight,
                               std::optional<size_t> group) {
  const PixelRect& rect = tile_->rect();
  if (x < rect.x0 || x >= rect.x1 || y < rect.y0 || y >= rect.y1) return;
  const size_t p = rect.IndexOf(x, y);
  double* const sums = pass_.data() + p * stride_;
  double* const of_group = group ? sums + 3 + 3 * *group : nullptr;
  const auto with = SumWith(sums, value, weight);
  const auto with_group = group && with ? SumWith(of_group, value, weight) : with;
  if (!with || !with_group) {
    ++tile_->channel(FilmChannel::kNonFiniteCount)[p];
    return;
  }
  std::ranges::copy(*with, sums);
  if (group) std::ranges::copy(*with_group, of_group);
}

void LightPassAccumulator::AddBias(int32_t x, int32_t y, const Rgb& bias) {
  const PixelRect& rect = tile_->rect();
  if (x < rect.x0 || x >= rect.x1 || y < rect.y0 || y >= rect.y1 || bias_at_ == stride_) return;
  double* const sums = pass_.data() + rect.IndexOf(x, y) * stride_ + bias_at_;
  const auto with = SumWith(sums, bias, 1);
  if (!with) return;
  std::ranges::copy(*with, sums);
  if (ReplicateOf(tile_->block().first + pass_count_) % 2 == 0) std::ranges::copy(*with, sums + 3);
}

void LightPassAccumulator::EndPass() {
  const uint64_t slot = pass_count_;
  SHEAF_CHECK(slot < tile_->block().count);
  for (size_t i = 0; i < 3; ++i) {
    float* plane = tile_->replicate(static_cast<uint32_t>(slot), i);
    const double* sum = pass_.data() + i;
    for (size_t p = 0; p < tile_->plane_size(); ++p, sum += stride_) {
      plane[p] = static_cast<float>(*sum);
    }
  }
  std::fill_n(tile_->replicate(static_cast<uint32_t>(slot), 3), tile_->plane_size(), 1.0F);
  for (uint64_t n = pass_count_++; n & 1; n >>= 1) {
    MergeInto(stack_.back(), &pass_);
    unused_.push_back(std::move(stack_.back()));
    stack_.pop_back();
  }
  stack_.push_back(std::move(pass_));
  if (unused_.empty()) {
    pass_ = Sums(pass_count_ < tile_->block().count ? stack_.back().size() : 0);
    return;
  }
  pass_ = std::move(unused_.back());
  unused_.pop_back();
  std::ranges::fill(pass_, 0);
}

void LightPassAccumulator::Finish() {
  SHEAF_CHECK(pass_count_ == tile_->block().count && stack_.size() == 1);
  const Sums& root = stack_.front();
  const size_t first_mean = tile_->mean_count() - (stride_ - 3);
  for (size_t i = 0; i < stride_; ++i) {
    float* const hi = i < 3 ? tile_->channel(kHeads[i]) : tile_->mean(first_mean + i - 3, 0);
    float* const lo = i < 3 ? tile_->channel(kTails[i]) : tile_->mean(first_mean + i - 3, 1);
    for (size_t p = 0; p < tile_->plane_size(); ++p) {
      const DoubleFloat wide = DoubleFloat::Make(root[p * stride_ + i]);
      hi[p] = wide.hi;
      lo[p] = wide.lo;
    }
  }
  const auto count = static_cast<float>(pass_count_);
  for (const FilmChannel channel : {FilmChannel::kWeight, FilmChannel::kSampleCount}) {
    std::fill_n(tile_->channel(channel), tile_->plane_size(), count);
  }
}

}  // namespace sheaf
