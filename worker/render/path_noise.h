// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathNoise: the contributions of kinds of paths to an image's noise. The variance of a pixel
// is the sum of the covariances of each kind's contribution with the whole, so the kinds' fractions
// of it add up; where two kinds are negatively correlated (a path that hits a mirror does not hit a
// wall), a fraction may be negative.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
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

// The tile's samples 0 to `samples`, relative to `floor` plus the tile's mean, so that dark tiles
// count as much as bright ones. Sums over tiles: Add. Requires: the scene's settings request light
// paths and no other output; at least 2 kReplicateCount samples. Runs on the calling thread.
class PathNoiseSums {
 public:
  // floor: one tenth of the image's mean of R, G and B together.
  static absl::StatusOr<PathNoiseSums> Of(const CompiledScene& scene, PixelRect tile,
                                          uint64_t samples, double floor);
  void Add(const PathNoiseSums& other);
  PathNoise Fractions() const;

 private:
  struct Kind {
    double light = 0, covariance = 0, variance = 0, one_replicate = 0;
  };
  std::array<Kind, kLightPathKindCount> kinds_;
  Kind all_;
};

}  // namespace sheaf::render
