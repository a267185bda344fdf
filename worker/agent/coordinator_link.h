// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CoordinatorLink: the agent's only interface to the coordinator. worker/service implements it over
// gRPC, tests with a fake that loses replies.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "worker/agent/work.h"

namespace sheaf::worker {

class CoordinatorLink {
 public:
  virtual ~CoordinatorLink() = default;

  // Idempotent; one attempt with a deadline, which the agent repeats. Errors: kUnavailable,
  // kDeadlineExceeded and similar (repeat); kPermissionDenied (quarantined); kFailedPrecondition
  // (the versions of the protocol do not fit: repeat, but seldom).
  virtual absl::StatusOr<DesiredState> Synchronize(const WorkerState& state) = 0;

  // Returns one outcome per part, in order; by then all parts are durable at the coordinator.
  // Idempotent; one attempt. Errors: kInvalidArgument (one of the parts does not match its
  // description), kPermissionDenied (one was not leased to this worker); repeat after any other.
  // Thread safety: may be called while Synchronize runs.
  virtual absl::StatusOr<std::vector<UploadOutcome>> UploadResults(
      const std::string& worker_id, const std::vector<const FinishedPart*>& parts) = 0;

  // UploadResults and then Synchronize, in one call, where the coordinator offers that
  // (DesiredState::deliveries). Idempotent; one attempt with the deadline of Synchronize. Errors:
  // those of both.
  // Thread safety: no Synchronize runs meanwhile.
  virtual absl::StatusOr<Delivery> Deliver(const WorkerState& state,
                                           const std::vector<const FinishedPart*>& parts) = 0;

  // Makes running and later calls return soon, with any error, because the worker is ending. Thread
  // safety: may be called while the others run.
  virtual void Abort() = 0;
};

}  // namespace sheaf::worker
