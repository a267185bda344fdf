// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameRounds: advances frames from one round to the next (sample_rounds.h), and records points of
// the error curve for frames without rounds.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/round_previews.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class FrameRounds {
 public:
  // All arguments must outlive the object.
  FrameRounds(FarmTables* tables, JobStore* store, RoundPreviews* previews, DiskState* disk)
      : tables_(*tables), store_(*store), previews_(*previews), disk_(*disk) {}

  // Makes the decision at the end of a round, and begins the next one. Returns whether the frame is
  // done. Requires: all tiles are developed. Errors: those of the store.
  absl::StatusOr<bool> Finish(OpenFrame* frame, const FrameId& id)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame->mutex);
  // Records a point of the curve of a frame without rounds if one is due, or at its end. A point
  // that cannot be stored is skipped. Requires: the image is refreshed.
  void NotePoint(OpenFrame* frame, const FrameId& id, bool ended)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame->mutex);
  // Adds the stop reason and the error curve to the image's metadata.
  void AddMetadata(const FrameId& id, FrameImage* image) const;

 private:
  // A record of the frame's present image, with the errors of its cells; without a decision.
  RoundRecord RecordOf(const OpenFrame& frame, const FrameId& id,
                       const std::vector<ErrorSums>& errors) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame.mutex);
  void KeepPreview(const OpenFrame& frame, const FrameId& id, int32_t round)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame.mutex);

  FarmTables& tables_;
  JobStore& store_;
  RoundPreviews& previews_;
  DiskState& disk_;
};

}  // namespace sheaf::coordinator
