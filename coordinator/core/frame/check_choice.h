// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CheckChoice: selects the tasks that are rendered twice, to detect false results. The choice
// cannot be predicted without the farm's secret, and equal tasks give equal answers: requesting the
// same work again reveals nothing.
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "common/film/task_kind.h"
#include "common/film/tile_cells.h"
#include "common/film/tile_geometry.h"

namespace sheaf::coordinator {

// Pure. Thread safety: all members may be called concurrently.
class CheckChoice {
 public:
  // secret: known to the coordinator alone.
  explicit CheckChoice(std::string secret) : secret_(std::move(secret)) {}

  // A number in [0, 1), uniform over tasks. A task is checked if its number is below the fraction
  // of tasks to check.
  double DrawOf(std::string_view frame_digest, const PixelRect& tile, SampleBlock block,
                const TileCells& cells, TaskKind kind = TaskKind::kCamera) const;

 private:
  const std::string secret_;
};

}  // namespace sheaf::coordinator
