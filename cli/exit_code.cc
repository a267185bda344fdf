// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/exit_code.h"

#include <string>

#include "cli/message.h"

namespace sheaf::cli {

ExitCode ReportError(ExitCode code, const absl::Status& status) {
  PrintError(code, std::string(status.message()));
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

ExitCode ReportOutputError(const absl::Status& status) {
  return ReportError(absl::IsInvalidArgument(status) ? ExitCode::kUsage : ExitCode::kFile, status);
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
