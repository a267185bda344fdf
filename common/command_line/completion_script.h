// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Shell completion scripts, generated from the options that the command line accepts.
#pragma once

#include <string>
#include <vector>

namespace sheaf {

struct CompletionOption {
  std::string name;  // "--samples"
  std::string help;  // One line.
  bool takes_value = false;
  std::vector<std::string> choices = {};  // Values it accepts; empty: files.
  std::vector<std::string> listed = {};   // The words of a list that commas separate.
};
struct CompletionCommand {
  std::string name, help;
  std::vector<CompletionOption> options;
  // Completion of its argument: these words, the names of jobs, or else files.
  std::vector<std::string> choices = {};
  bool takes_job = false;
};

struct CompletionProgram {
  std::string name;                       // "sheaf"
  std::vector<CompletionOption> options;  // Without a command.
  std::vector<CompletionCommand> commands;
  // Prints the names of the coordinator's jobs, one per line; for commands that take one.
  std::string job_names_command;
};

enum class Shell { kBash, kZsh, kFish };

// The script that completes subcommands, options and their values.
std::string CompletionScript(Shell shell, const CompletionProgram& program);

}  // namespace sheaf
