// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Runs a command that the user gave on this machine's command line, with the user's rights. Text
// from a job or from another machine must never become such a command.
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sheaf::cli {

// The words of the command as a shell splits them, with quotes, $VARIABLES, ~ and *; the first one
// is the path of its program, which is looked up in PATH. A path of a program, also one with
// spaces, is one word. No shell runs: pipes, redirections and $(...) are errors. Errors:
// kInvalidArgument, also if there is no such program.
absl::StatusOr<std::vector<std::string>> ParseCommand(const std::string& command);

// Runs the program until it ends, then ends its group of processes. Its input is empty, and its
// output goes to the file `log`. Errors: kFailedPrecondition if it cannot be started, ends with a
// status other than 0 or by a signal, or is killed after time_max; the text begins with a verb and
// has the last line of the log. kCancelled if stop is requested, which kills it.
absl::Status RunCommand(const std::vector<std::string>& words, const std::string& log,
                        absl::Duration time_max, const std::stop_token& stop);

}  // namespace sheaf::cli
