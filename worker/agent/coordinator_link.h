// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CoordinatorLink: the agent's only way to the coordinator. worker/service implements it over gRPC,
// tests with a fake that loses replies.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "worker/agent/work.h"

namespace sheaf::worker {

class CoordinatorLink {
 public:
  virtual ~CoordinatorLink() = default;

  // Idempotent; one attempt with a deadline, the agent repeats it.
  // Errors: kUnavailable, kDeadlineExceeded and so on (repeat); kPermissionDenied (quarantined).
  virtual absl::StatusOr<DesiredState> Synchronize(const WorkerState& state) = 0;

  // Returns one outcome per part, in order; then all of them are durable at the coordinator.
  // Idempotent; one attempt. Errors: kInvalidArgument (one of the parts is not what it says);
  // others are to be repeated. Thread safety: may be called while Synchronize runs.
  virtual absl::StatusOr<std::vector<UploadOutcome>> UploadResults(
      const std::string& worker_id, const std::vector<const FinishedPart*>& parts) = 0;

  // Makes running and later calls return soon, with any error: the worker ends. Thread safety: may
  // be called while the others run.
  virtual void Abort() = 0;
};

}  // namespace sheaf::worker
