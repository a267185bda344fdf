// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Command: one subcommand of sheaf. main creates each of them once, in the order of the help.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <vector>

#include "cli/exit_code.h"

namespace sheaf::cli {

class Command {
 public:
  virtual ~Command() = default;
  // Adds the subcommand with its options to app and returns it. Called once. Requires: this
  // outlives app.
  virtual CLI::App* AddTo(CLI::App* app) = 0;
  // Executes the subcommand. Called after its options were parsed.
  virtual ExitCode Run() = 0;
};

std::unique_ptr<Command> MakeRenderCommand();
std::unique_ptr<Command> MakeQuoteCommand();
std::unique_ptr<Command> MakeSubmitCommand();
std::unique_ptr<Command> MakeWatchCommand();
std::unique_ptr<Command> MakeListCommand();
std::unique_ptr<Command> MakeShowCommand();
// Those that change jobs, in the order of the help.
std::vector<std::unique_ptr<Command>> MakeChangeCommands();
std::unique_ptr<Command> MakeDeleteCommand();
std::unique_ptr<Command> MakeLogsCommand();
std::unique_ptr<Command> MakeRefineCommand();
std::unique_ptr<Command> MakeRetryCommand();
std::unique_ptr<Command> MakeKillCommand();
std::unique_ptr<Command> MakeBundleCommand();
std::unique_ptr<Command> MakeReproCommand();
std::unique_ptr<Command> MakeWorkersCommand();
std::unique_ptr<Command> MakeShareCommand();
std::unique_ptr<Command> MakeApproveCommand();
std::unique_ptr<Command> MakeDrainCommand();
std::unique_ptr<Command> MakeUndrainCommand();
std::unique_ptr<Command> MakeGcCommand();
std::unique_ptr<Command> MakeUsageCommand();
std::unique_ptr<Command> MakePlanCommand();
std::unique_ptr<Command> MakeStudyCommand();
std::unique_ptr<Command> MakeCompareCommand();
std::unique_ptr<Command> MakePackCommand();
std::unique_ptr<Command> MakeViewCommand();
std::unique_ptr<Command> MakeLoginCommand();
std::unique_ptr<Command> MakePageCommand();
std::unique_ptr<Command> MakeCompletionCommand();

}  // namespace sheaf::cli
