// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Shell completion, written from what the command line really accepts.
#pragma once

#include <string>
#include <vector>

namespace sheaf::cli {

struct CompletionOption {
  std::string name;  // "--samples"
  std::string help;  // One line.
  bool takes_value = false;
  std::vector<std::string> choices = {};  // Of the value; none: files.
};
struct CompletionCommand {
  std::string name, help;
  std::vector<CompletionOption> options;
  // Its argument: these words, the names of jobs, or else files.
  std::vector<std::string> choices = {};
  bool takes_job = false;
};

// The command that prints the names of the coordinator's jobs, one a line.
inline constexpr char kJobNamesCommand[] = "sheaf completion jobs 2>/dev/null";

enum class Shell { kBash, kZsh, kFish };

// The script that completes subcommands, their options and what these take.
std::string CompletionScript(Shell shell, const std::vector<CompletionCommand>& commands);

}  // namespace sheaf::cli
