// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/light/light_part_size.h"

#include <algorithm>
#include <cstddef>

#include "common/film/film_tile.h"
#include "common/film/task_kind.h"

namespace sheaf {
namespace {

// Layers of `light_paths` that light paths can reach: all but light that is emitted towards the
// camera, or seen by specular scattering alone.
constexpr size_t kLayersReachedMax = 7;

}  // namespace

uint64_t LightPartBytes(int64_t pixel_count, const FilmOutputs& outputs, uint64_t pass_count) {
  const size_t groups = outputs.light_paths
                            ? std::min(kLayersReachedMax, outputs.light_groups.size())
                            : outputs.light_groups.size();
  // R, G and B: heads and tails of the image, of each group and of the bias, and of each replicate
  // the heads; then the count of what is not finite.
  const uint64_t bias_planes = HasMergeBias(outputs) ? 2 * kMergeBiasMeanCount : 0;
  const uint64_t planes = 6 + 6 * groups + bias_planes + 3 * pass_count + 1;
  // Weights and counts: the same number in each pixel. Run lengths code only two of its four bytes.
  const uint64_t constant_planes = pass_count + 2;
  const uint64_t zero_planes = kFilmChannelCount - 9;
  return static_cast<uint64_t>(pixel_count) * sizeof(float) *
         (16 * planes + 8 * constant_planes + zero_planes) / 16;
}

}  // namespace sheaf
