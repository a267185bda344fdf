// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/render_failure.h"

namespace sheaf::worker {

FailureKind RenderFailureKind(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kAborted:
      return FailureKind::kReleased;
    case absl::StatusCode::kResourceExhausted:
      return FailureKind::kMemory;
    case absl::StatusCode::kDataLoss:
    case absl::StatusCode::kUnavailable:
      return FailureKind::kInfrastructure;
    default:
      return FailureKind::kInternal;
  }
}

}  // namespace sheaf::worker
