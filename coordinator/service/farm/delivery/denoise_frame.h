// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DenoiseFrame: the denoised output of a finished frame (docs/denoise.md). The halves of replicates
// that it needs are read again from the frame's parts, so that frames with denoising take no extra
// memory while they render.
#pragma once

#include "absl/status/statusor.h"
#include "coordinator/service/farm/delivery/tile_builder.h"
#include "coordinator/service/farm/state/open_frame.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// Sets the layers of the image, and its metadata "denoisedMse", the expected mean squared error.
// If parts were lost, returns them for rendering and returns false. Takes as long as Denoise, on
// half of the machine's processors.
// Requires: the image has the denoised output, and all tiles are developed.
// Errors: those of the store; kFailedPrecondition if the parts on disk are not those of the image.
absl::StatusOr<bool> DenoiseFrame(const FrameId& id, JobStore* store, TileBuilder* tiles,
                                  OpenFrame* frame) ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame->mutex);

}  // namespace sheaf::coordinator
