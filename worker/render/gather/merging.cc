// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/gather/merging.h"

#include <cmath>

#include "common/film/film_tile.h"
#include "common/math/elementary.h"
#include "common/math/mix_bits.h"
#include "worker/render/sampling/dimensions.h"
#include "worker/render/sampling/sampler.h"

namespace sheaf::render {
namespace {

// Changes the seed of the numbers of whole passes.
constexpr uint64_t kPassSeed = 0x7061737373616d70u;

}  // namespace

uint32_t GatherStep(int64_t pixel_count) {
  const auto pixels = static_cast<uint64_t>(pixel_count);
  return static_cast<uint32_t>((pixels + kGatherPointsMax - 1) / kGatherPointsMax);
}

uint64_t GatherPointsMax(const PixelRect& window, uint32_t step) {
  const uint64_t of_row = (static_cast<uint64_t>(window.Width()) + step - 1) / step;
  return of_row * static_cast<uint64_t>(window.Height());
}

bool GathersAt(uint64_t seed, int64_t pixel, uint64_t pass, uint32_t step) {
  if (step <= 1) return true;
  const uint64_t start = MixBits(seed + ReplicateOf(pass));
  return (static_cast<uint64_t>(pixel) + start % step + IndexInReplicate(pass)) % step == 0;
}

float MergeRadius(double ray_density) {
  if (!(ray_density > 0)) return 0;
  const double radius = kMergeFootprints / std::sqrt(ray_density);
  return std::isfinite(radius) ? static_cast<float>(radius) : 0;
}

float MergeRadiusScale(uint64_t pass) {
  const auto number = static_cast<double>(IndexInReplicate(pass) + 1);
  return static_cast<float>(Pow(number, (kMergeAlpha - 1) / 2));
}

PassSample MakePassSample(uint64_t seed, uint64_t pass, bool one_sequence) {
  const Sampler sampler(seed ^ kPassSeed, 0, 0, pass, one_sequence);
  return {sampler.Get1(Slot(CameraSlot::kTime)), sampler.Get1(Slot(CameraSlot::kWavelength))};
}

}  // namespace sheaf::render
