// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Exit codes of sheaf, for scripts. They are listed in sheaf --help and never renumbered.
#pragma once

#include "absl/status/status.h"

namespace sheaf::cli {

enum class ExitCode : int {
  kOk = 0,
  // The job failed, compared images differ by more than the tolerance, a task failed as its bundle
  // records, or the coordinator refused the call, for example for an unknown job.
  kFailed = 1,
  kUsage = 2,
  kUnreachable = 3,  // The coordinator does not answer.
  kBadScene = 4,
  kCancelled = 5,  // The job was cancelled.
  kFile = 6,       // A file on this machine cannot be read or written.
  kOtherwise = 7,  // A task failed in another way than its bundle records.
  kInterrupted = 130,
};

// The lines of sheaf --help that list the exit codes.
inline constexpr const char* kExitCodeHelp =
    "Exit codes: 0 done; 1 the job or task failed or does not exist, or images differ; 2 wrong\n"
    "usage; 3 the coordinator does not answer; 4 the scene has errors; 5 the job was cancelled; 6 "
    "a file\n"
    "cannot be read or written; 7 a task failed otherwise than its bundle records;\n"
    "130 interrupted.";

// Prints "sheaf: MESSAGE" to standard error and returns the code for a failed call.
ExitCode ReportCallError(const absl::Status& status);
// As ReportCallError, for a failed PrepareJob: an error in the scene or a file, or an interruption.
ExitCode ReportSceneError(const absl::Status& status);
// As ReportCallError, for a failed CheckOutputs: wrong usage, or a file that cannot be written.
ExitCode ReportOutputError(const absl::Status& status);
// Prints the same and returns `code`.
ExitCode ReportError(ExitCode code, const absl::Status& status);

}  // namespace sheaf::cli
