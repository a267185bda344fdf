// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FrameDelivery: the background thread's work on open frames. It refreshes their previews, and
// develops, writes and delivers complete frames.
#pragma once

#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "coordinator/service/farm/delivery/delivered_images.h"
#include "coordinator/service/farm/delivery/frame_rounds.h"
#include "coordinator/service/farm/delivery/image_attributes.h"
#include "coordinator/service/farm/delivery/tile_builder.h"
#include "coordinator/service/farm/jobs/job_ends.h"
#include "coordinator/service/farm/state/delivery_queue.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_signals.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// Thread safety: one thread at a time.
class FrameDelivery {
 public:
  // The objects that it works on; all must outlive it.
  struct Parts {
    FarmTables& tables;
    JobStore& store;
    TileBuilder& tiles;
    FrameRounds& rounds;
    DeliveredImages& images;
    JobEnds& ends;
    DeliveryQueue& queue;
    DiskState& disk;
    FarmSignals& signals;
    const BlobStore& blobs;
  };
  FrameDelivery(absl::Duration preview_interval_min, const Parts& parts)
      : preview_interval_min_(preview_interval_min),
        tables_(parts.tables),
        store_(parts.store),
        tiles_(parts.tiles),
        rounds_(parts.rounds),
        images_(parts.images),
        ends_(parts.ends),
        queue_(parts.queue),
        disk_(parts.disk),
        signals_(parts.signals),
        attributes_(&parts.blobs) {}

  // Develops the changed tiles of frames whose previews are old enough.
  void RefreshFrames();
  // Delivers the frames of the queue. Frames that fail return to it.
  void DeliverFrames();

 private:
  absl::Status Deliver(const FrameId& id);
  // Builds the missing tiles of the image, completes it and writes it. Returns false if the frame
  // is not done: parts were lost, another round begins, or its job has ended.
  absl::StatusOr<bool> Finish(OpenFrame* frame, const FrameId& id, DeliveredFrame* delivered);
  std::map<std::string, std::string> MetadataOf(const FrameId& id, const FrameSpec& spec) const;
  DeliveredFrame Account(const FrameId& id, const OpenFrame& frame) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame.mutex);
  // DeliveredFrame::one_sequence_gain.
  double PriceOfErrorBars(const FrameId& id, const FrameSpec& spec) const;
  // Adds the data that a quote needs from a pilot's frame: the light layer, and the CPU seconds of
  // workers for the tiles of a lattice, for light passes and for the training, if it has any.
  void AddPilotFindings(const FrameId& id, OpenFrame* frame) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame->mutex);

  const absl::Duration preview_interval_min_;
  FarmTables& tables_;
  JobStore& store_;
  TileBuilder& tiles_;
  FrameRounds& rounds_;
  DeliveredImages& images_;
  JobEnds& ends_;
  DeliveryQueue& queue_;
  DiskState& disk_;
  FarmSignals& signals_;
  const ImageAttributes attributes_;
};

}  // namespace sheaf::coordinator
