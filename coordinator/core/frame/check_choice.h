// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CheckChoice: which tasks are rendered twice, to notice false results. Nobody without the farm's
// secret can foretell it, and equal tasks give equal answers: who asks for the same work again
// learns nothing.
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

  // A number in [0, 1), evenly spread over tasks: one below the fraction of tasks that are checked
  // chooses its task.
  double DrawOf(std::string_view frame_digest, const PixelRect& tile, SampleBlock block,
                const TileCells& cells, TaskKind kind = TaskKind::kCamera) const;

 private:
  const std::string secret_;
};

}  // namespace sheaf::coordinator
