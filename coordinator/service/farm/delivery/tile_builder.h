// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TileBuilder: builds a tile of an open frame from its parts on disk and from the image that the
// frame resumes.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/farm/state/part_removals.h"
#include "coordinator/service/farm/state/resumed_frames.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class TileBuilder {
 public:
  // All arguments must outlive the object.
  TileBuilder(FarmTables* tables, JobStore* store, const ResumedFrames* resumed,
              PartRemovals* removals)
      : tables_(*tables), store_(*store), resumed_(*resumed), removals_(*removals) {}

  // Returns damaged parts for rendering; the tile is then marked as on disk, and is complete once
  // they are rendered. Errors: those of the store; those of ResumedFrames::Open.
  absl::Status Rebuild(OpenFrame* frame, const FrameId& id, uint32_t tile)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame->mutex);

  // Returns a lost or damaged part, or a guiding field, to be made again.
  void RevokePart(const PartRow& row, const absl::Status& why);

 private:
  // Inserts the parts of a tile that the resumed image replaces; none if the frame does not resume
  // one.
  absl::Status InsertResumed(OpenFrame* frame, uint32_t tile, CellTrees* trees) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame->mutex);

  FarmTables& tables_;
  JobStore& store_;
  const ResumedFrames& resumed_;
  PartRemovals& removals_;
};

}  // namespace sheaf::coordinator
