// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Which light paths make a picture's noise. The variance of a pixel is the sum of the covariances
// of what each kind of path contributes with the whole, so kinds have shares of it that add up;
// where two kinds vary against each other (a path that mirrors throw is one that walls do not get),
// a share may be negative.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/light_path_kind.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {

struct PathShares {
  double light = 0;     // Of the picture's sum of R, G and B.
  double variance = 0;  // Of its variance.
  // Of the kind's own variance, what one replicate of a pixel's 16 makes: above kOneReplicateMax
  // (mean_interval.h) it comes in rare bright samples.
  double one_replicate = 0;
};

struct PathNoise {
  std::array<PathShares, kLightPathKindCount> kinds;
  double one_replicate_share = 0;  // Of all together: the tile's error is reliable or is not.
};

// Of the tile's samples 0 to `samples`: relative to `floor` and the tile's mean, so that dark tiles
// count as bright ones do. Sums over tiles: Add. Requires: the scene's settings ask for light paths
// and nothing else; at least 2 kReplicateCount samples. On the calling thread.
class PathNoiseSums {
 public:
  // floor: of R, G and B together, what a tenth of the picture's mean is.
  static absl::StatusOr<PathNoiseSums> Of(const CompiledScene& scene, PixelRect tile,
                                          uint64_t samples, double floor);
  void Add(const PathNoiseSums& other);
  PathNoise Shares() const;

 private:
  struct Kind {
    double light = 0, covariance = 0, variance = 0, one_replicate = 0;
  };
  std::array<Kind, kLightPathKindCount> kinds_;
  Kind all_;
};

}  // namespace sheaf::render
