// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Shell completion scripts, generated from the options that the command line accepts.
#pragma once

#include <string>
#include <vector>

namespace sheaf::cli {

struct CompletionOption {
  std::string name;  // "--samples"
  std::string help;  // One line.
  bool takes_value = false;
  std::vector<std::string> choices = {};  // Values it accepts; empty: files.
};
struct CompletionCommand {
  std::string name, help;
  std::vector<CompletionOption> options;
  // Completion of its argument: these words, the names of jobs, or else files.
  std::vector<std::string> choices = {};
  bool takes_job = false;
};

// The command that prints the names of the coordinator's jobs, one per line.
inline constexpr char kJobNamesCommand[] = "sheaf completion jobs 2>/dev/null";

enum class Shell { kBash, kZsh, kFish };

// The script that completes subcommands, their options and option values.
std::string CompletionScript(Shell shell, const std::vector<CompletionCommand>& commands);

}  // namespace sheaf::cli
