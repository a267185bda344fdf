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
};
struct CompletionCommand {
  std::string name, help;
  std::vector<CompletionOption> options;
};

enum class Shell { kBash, kZsh, kFish };

// The script that completes subcommands and their options; everything else completes to files.
std::string CompletionScript(Shell shell, const std::vector<CompletionCommand>& commands);

}  // namespace sheaf::cli
