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
#include "cli/job/own_command.h"
#include "cli/message.h"
#include "common/base/load_phases.h"
#include "common/base/log.h"
#include "common/base/open_files.h"
#include "common/base/surroundings/standard_streams.h"
#include "common/command_line/command_line.h"
#include "common/rpc/protocol_version.h"
#include "worker/sandbox/scene_server.h"

namespace sheaf::cli {
namespace {

struct CommandGroup {
  const char* title;
  std::vector<std::unique_ptr<Command>> commands;
};

template <typename... Commands>
CommandGroup Group(const char* title, Commands... commands) {
  CommandGroup group{title, {}};
  (group.commands.push_back(std::move(commands)), ...);
  return group;
}

// In the order of the help.
std::vector<CommandGroup> MakeCommands() {
  std::vector<CommandGroup> groups;
  groups.push_back(Group("Render on this machine", MakeRenderCommand(), MakeQuoteCommand(),
                         MakePlanCommand(), MakeStudyCommand(), MakeCompareCommand(),
                         MakePackCommand(), MakeViewCommand()));
  groups.push_back(Group("Render on a farm", MakeSubmitCommand(), MakeWatchCommand(),
                         MakeListCommand(), MakeShowCommand(), MakeLogsCommand(),
                         MakeRefineCommand()));
  groups.push_back({"Change jobs", MakeChangeCommands()});
  groups.push_back(Group("Failed work", MakeRetryCommand(), MakeKillCommand(), MakeBundleCommand(),
                         MakeReproCommand()));
  groups.push_back(Group("Look after a farm", MakeWorkersCommand(), MakeDrainCommand(),
                         MakeUndrainCommand(), MakeShareCommand(), MakeUsageCommand(),
                         MakeGcCommand()));
  groups.push_back(
      Group("Access and shell", MakeLoginCommand(), MakePageCommand(), MakeCompletionCommand()));
  return groups;
}

// "sheaf help [COMMAND]" and "sheaf version" as options, which the parser knows.
std::vector<char*> WithWordsAsOptions(int argc, char** argv) {
  static char help[] = "--help", version[] = "--version";
  std::vector<char*> words(argv, argv + argc);
  const std::string_view first = argc > 1 ? argv[1] : "";
  if (first == "version" && argc == 2) words[1] = version;
  if (first == "help" && argc <= 3) {
    words.erase(words.begin() + 1);
    words.push_back(help);
  }
  return words;
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
  app.footer(std::string("sheaf help COMMAND explains a command, with examples.\n") +
             kExitCodeHelp);
  const std::vector<CommandGroup> groups = MakeCommands();
  std::vector<std::pair<CLI::App*, Command*>> added;
  for (const CommandGroup& group : groups) {
    for (const std::unique_ptr<Command>& command : group.commands) {
      added.emplace_back(command->AddTo(&app), command.get());
      added.back().first->group(group.title);
    }
  }
  std::vector<char*> words = WithWordsAsOptions(argc, argv);
  if (RequestsJson(argc, argv)) UseJsonMessages();
  NoteOwnCommand(argc, argv);
  const auto report = [](const std::string& text) { PrintError(ExitCode::kUsage, text); };
  if (const std::optional<int> code =
          ParseCommandLine(&app, static_cast<int>(words.size()), words.data(), report)) {
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
  sheaf::NoteProgramStart();
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
