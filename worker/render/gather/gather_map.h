// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GatherMap: what light paths of one pass are merged with.
#pragma once

#include "worker/render/gather/gather_grid.h"
#include "worker/render/gather/merging.h"
#include "worker/render/gather/path_arena.h"

namespace sheaf::render {

struct GatherMap {
  PassSample sample;
  float radius_scale = 1;  // MergeRadiusScale of the pass.
  PathArena arena;
  GatherGrid grid;

  // The most bytes of a map of `point_count` points.
  static uint64_t BytesMax(uint64_t point_count) {
    return point_count * (kGatherPointBytesMax + sizeof(GatherBall) + GatherGrid::kPointBytesMax);
  }
};

}  // namespace sheaf::render
