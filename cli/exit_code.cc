// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/exit_code.h"

#include <cstdio>
#include <string>

namespace sheaf::cli {

ExitCode ReportError(ExitCode code, const absl::Status& status) {
  std::fprintf(stderr, "sheaf: %s\n", std::string(status.message()).c_str());
  return code;
}

ExitCode ReportCallError(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDeadlineExceeded:
      return ReportError(ExitCode::kUnreachable, status);
    case absl::StatusCode::kCancelled:
      return ReportError(ExitCode::kInterrupted, status);
    default:
      return ReportError(ExitCode::kFailed, status);
  }
}

ExitCode ReportSceneError(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kUnimplemented:
    case absl::StatusCode::kResourceExhausted:
      return ReportError(ExitCode::kBadScene, status);
    default:
      return ReportError(ExitCode::kFile, status);
  }
}

}  // namespace sheaf::cli
