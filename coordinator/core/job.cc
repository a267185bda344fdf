// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job.h"

namespace sheaf::coordinator {

const char* FailureKindName(FailureKind kind) {
  switch (kind) {
    case FailureKind::kReleased:
      return "released";
    case FailureKind::kInfrastructure:
      return "infrastructure";
    case FailureKind::kScene:
      return "scene";
    case FailureKind::kMemory:
      return "memory";
    case FailureKind::kInternal:
      return "internal";
    case FailureKind::kLost:
      return "lost";
    case FailureKind::kLoading:
      return "loading";
  }
  return "unknown";
}

}  // namespace sheaf::coordinator
