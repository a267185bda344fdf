// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathNoise: the contributions of kinds of paths to an image's noise. The variance of a pixel
// is the sum of the covariances of each kind's contribution with the whole, so the kinds' fractions
// of it add up; where two kinds are negatively correlated (a path that hits a mirror does not hit a
// wall), a fraction may be negative.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "common/film/light_path_kind.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {

struct PathFractions {
  double light = 0;     // Fraction of the image's sum of R, G and B.
  double variance = 0;  // Fraction of its variance.
  // Fraction of the kind's own variance that comes from a single one of a pixel's 16 replicates:
  // above kOneReplicateMax (mean_interval.h) the variance comes from rare bright samples.
  double one_replicate = 0;
};

struct PathNoise {
  std::array<PathFractions, kLightPathKindCount> kinds;
  double one_replicate_fraction = 0;  // All kinds together: whether the tile's error is reliable.
};

// One pixel of a row-major rectangle: the weighted sum of R, G and B by kind of path and replicate,
// and the sum of weights by replicate.
struct PixelPaths {
  std::array<std::array<double, kReplicateCount>, kLightPathKindCount> kinds{};
  std::array<double, kReplicateCount> weights{};
};
using PathSums = std::vector<PixelPaths>;

// The paths that begin at lights, over the window of the scene's frame: its first `passes` light
// passes, on `threads` threads. Requires: the scene's settings request light paths (of
// FilmOutputs) and no other output, and their techniques have light paths; at least
// 2 kReplicateCount passes. Errors: as RenderLightPass.
absl::StatusOr<PathSums> SumLightPaths(const CompiledScene& scene, uint64_t passes, int threads);

// The light of a tile's pixels that begins at lights, where the frame has such: sums, and the index
// in them of the pixel that shows what pixel (x, y) of the frame shows.
struct LightBeside {
  const PathSums* sums = nullptr;  // Null: none.
  std::function<size_t(int32_t x, int32_t y)> index_of;
};

// The tile's samples 0 to `samples`, relative to `floor` plus the tile's mean, so that dark tiles
// count as much as bright ones. Its paths are those of the camera, and those of `light`; the two
// are independent. Sums over tiles: Add. Requires: the scene's settings request light paths and no
// other output; at least 2 kReplicateCount samples. Runs on the calling thread.
class PathNoiseSums {
 public:
  // floor: one tenth of the image's mean of R, G and B together.
  static absl::StatusOr<PathNoiseSums> Of(const CompiledScene& scene, PixelRect tile,
                                          uint64_t samples, double floor,
                                          const LightBeside& light = {});
  void Add(const PathNoiseSums& other);
  PathNoise Fractions() const;

 private:
  struct Kind {
    double light = 0, covariance = 0, variance = 0, one_replicate = 0;
  };
  // A pixel's means and deviations by kind.
  void AddPixel(
      const std::array<double, kLightPathKindCount>& means,
      const std::array<std::array<double, kReplicateCount>, kLightPathKindCount>& deviations,
      double divisor);

  std::array<Kind, kLightPathKindCount> kinds_;
  Kind all_;
};

}  // namespace sheaf::render
