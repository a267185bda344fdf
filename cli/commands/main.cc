// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf: the command line client for all operations of the farm.
#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "cli/commands/command.h"
#include "cli/dropped/dropped_scene.h"
#include "cli/exit_code.h"
#include "cli/message.h"
#include "common/base/log.h"
#include "common/base/open_files.h"
#include "common/base/surroundings/standard_streams.h"
#include "common/command_line/command_line.h"
#include "common/rpc/protocol_version.h"
#include "worker/sandbox/scene_server.h"

namespace sheaf::cli {
namespace {

std::vector<std::unique_ptr<Command>> MakeCommands() {
  std::vector<std::unique_ptr<Command>> commands;
  commands.push_back(MakeRenderCommand());
  commands.push_back(MakeQuoteCommand());
  commands.push_back(MakeSubmitCommand());
  commands.push_back(MakeWatchCommand());
  commands.push_back(MakeListCommand());
  commands.push_back(MakeShowCommand());
  commands.push_back(MakeRefineCommand());
  commands.push_back(MakePauseCommand());
  commands.push_back(MakeResumeCommand());
  commands.push_back(MakePriorityCommand());
  commands.push_back(MakeCancelCommand());
  commands.push_back(MakeRetryCommand());
  commands.push_back(MakeKillCommand());
  commands.push_back(MakeBundleCommand());
  commands.push_back(MakeReproCommand());
  commands.push_back(MakeWorkersCommand());
  commands.push_back(MakeShareCommand());
  commands.push_back(MakePinCommand());
  commands.push_back(MakeUnpinCommand());
  commands.push_back(MakeReleaseCommand());
  commands.push_back(MakeApproveCommand());
  commands.push_back(MakeDrainCommand());
  commands.push_back(MakeUndrainCommand());
  commands.push_back(MakeGcCommand());
  commands.push_back(MakeUsageCommand());
  commands.push_back(MakePlanCommand());
  commands.push_back(MakeStudyCommand());
  commands.push_back(MakeCompareCommand());
  commands.push_back(MakeLoginCommand());
  commands.push_back(MakePageCommand());
  commands.push_back(MakeCompletionCommand());
  return commands;
}

// Checked before the command line is parsed, since parse errors are printed as JSON too.
bool RequestsJson(int argc, char** argv) {
  return std::any_of(argv + 1, argv + argc,
                     [](const char* word) { return std::string_view(word) == "--json"; });
}

ExitCode Main(int argc, char** argv) {
  // Our own errors are one line each; gRPC's internal messages would only add noise.
  setenv("GRPC_VERBOSITY", "NONE", /*replace=*/0);
  SetLogName("sheaf");
  ::signal(SIGXFSZ, SIG_IGN);  // Writing beyond ulimit -f fails instead.
  RaiseOpenFileLimit();
  CLI::App app("Renders scenes with one path tracer on any number of machines.", "sheaf");
  app.set_version_flag("--version", absl::StrCat("sheaf " SHEAF_VERSION ", ", DescribeProtocol()));
  app.require_subcommand(1);
  app.footer(std::string("sheaf COMMAND --help explains a command, with examples.\n") +
             kExitCodeHelp);
  const std::vector<std::unique_ptr<Command>> commands = MakeCommands();
  std::vector<std::pair<CLI::App*, Command*>> added;
  for (const std::unique_ptr<Command>& command : commands) {
    added.emplace_back(command->AddTo(&app), command.get());
  }
  if (RequestsJson(argc, argv)) UseJsonMessages();
  const auto report = [](const std::string& text) { PrintError(ExitCode::kUsage, text); };
  if (const std::optional<int> code = ParseCommandLine(&app, argc, argv, report)) {
    return static_cast<ExitCode>(*code);
  }
  for (const auto& [parsed, command] : added) {
    if (parsed->parsed()) return command->Run();
  }
  return ExitCode::kUsage;
}

}  // namespace
}  // namespace sheaf::cli

int main(int argc, char** argv) {
  if (argc == 2 && std::string_view(argv[1]) == sheaf::worker::kSceneProcessFlag) {
    return sheaf::worker::RunDirectSceneProcess();
  }
  if (argc == 2 && std::string_view(argv[1]) == sheaf::cli::kDroppedSceneFlag) {
    return sheaf::cli::RunDroppedScene();
  }
  const int code = static_cast<int>(sheaf::cli::Main(argc, argv));
  return sheaf::CodeAfterOutput(code, [](const std::string& text) {
    sheaf::cli::PrintError(sheaf::cli::ExitCode::kFile, text);
  });
}
