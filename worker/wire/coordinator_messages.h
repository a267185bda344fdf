// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Conversion between worker/agent's plain values and messages of proto/sheaf/v1/worker.proto.
#pragma once

#include "absl/status/statusor.h"
#include "sheaf/v1/worker.pb.h"
#include "worker/agent/work.h"

namespace sheaf::worker {

v1::SynchronizeRequest ToWire(const WorkerState& state);
// The header of a part; its bytes follow in chunks.
v1::ResultHeader ToWire(const FinishedPart& part, const std::string& worker_id);

// Errors: kInvalidArgument, naming the lease and its fault. Rejects everything that a renderer
// could not handle: empty tiles, unaligned blocks, tiles outside the window.
absl::StatusOr<DesiredState> FromWire(const v1::SynchronizeResponse& response);
absl::StatusOr<UploadOutcome> FromWire(int outcome);

}  // namespace sheaf::worker
