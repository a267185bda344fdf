// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// OpenFrame: a frame between its first part and its delivery: its merged parts and its image so
// far.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "common/film/error/running_error.h"
#include "common/film/exr/resumed_image.h"
#include "coordinator/core/frame/frame_merge.h"

namespace sheaf::coordinator {

// Shared: an upload may still merge into a frame whose job was just cancelled.
struct OpenFrame {
  // samples: of each cell's pixels. on_disk: tiles with parts already on disk.
  OpenFrame(FrameSpec frame_spec, CellGrid grid, std::vector<uint64_t> samples,
            uint64_t first_point_samples, MergeBudget* budget,
            const std::set<uint32_t>& on_disk = {})
      : spec(std::move(frame_spec)),
        merge(spec, std::move(grid), std::move(samples), budget),
        next_point_samples(first_point_samples),
        error(merge.grid().tiles()) {
    for (const uint32_t tile : on_disk) merge.MarkOnDisk(tile);
  }

  const FrameSpec spec;
  Mutex mutex;  // Taken before that of FarmTables.
  FrameMerge merge ABSL_GUARDED_BY(mutex);
  SteadyTime next_refresh_time ABSL_GUARDED_BY(mutex) = SteadyTime::InfinitePast();
  // The image that the frame resumes; read when a tile is first built from it.
  std::optional<ResumedImage> resumed ABSL_GUARDED_BY(mutex);
  // A frame without rounds gets its next point when every cell has this many samples.
  uint64_t next_point_samples ABSL_GUARDED_BY(mutex);
  RunningError error ABSL_GUARDED_BY(mutex);
};

}  // namespace sheaf::coordinator
