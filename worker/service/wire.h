// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// worker/agent's plain values to messages of proto/sheaf/v1/worker.proto and back.
#pragma once

#include "absl/status/statusor.h"
#include "sheaf/v1/worker.pb.h"
#include "worker/agent/work.h"

namespace sheaf::worker {

v1::SynchronizeRequest ToWire(const WorkerState& state);
// The header of a part; its bytes follow in chunks.
v1::ResultHeader ToWire(const FinishedPart& part, const std::string& worker_id);

// Errors: kInvalidArgument, naming the lease and what is wrong with it. Everything a renderer would
// trip over is refused here: empty tiles, blocks that are not aligned, tiles outside the window.
absl::StatusOr<DesiredState> FromWire(const v1::SynchronizeResponse& response);
absl::StatusOr<UploadOutcome> FromWire(int outcome);

}  // namespace sheaf::worker
