// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf completion: a script for the shell, from the very options that sheaf knows.
#include <cstdio>
#include <map>
#include <string>

#include "cli/command.h"
#include "cli/completion_script.h"

namespace sheaf::cli {
namespace {

CompletionCommand Describe(const CLI::App& command) {
  CompletionCommand description{command.get_name(), command.get_description(), {}};
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      description.options.push_back(
          {"--" + name, option->get_description(), option->get_items_expected_max() > 0});
    }
  }
  return description;
}

class CompletionCommandLine : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    app_ = app;
    CLI::App* command = app->add_subcommand("completion", "Print a completion script for a shell");
    command->add_option("SHELL", shell_, "bash, zsh or fish")
        ->required()
        ->transform(CLI::CheckedTransformer(std::map<std::string, Shell>{
            {"bash", Shell::kBash}, {"zsh", Shell::kZsh}, {"fish", Shell::kFish}}));
    command->footer(
        "Examples:\n"
        "  source <(sheaf completion bash)\n"
        "  sheaf completion zsh > ~/.zfunc/_sheaf\n"
        "  sheaf completion fish > ~/.config/fish/completions/sheaf.fish");
    return command;
  }

  ExitCode Run() override {
    std::vector<CompletionCommand> commands;
    for (const CLI::App* command : app_->get_subcommands({}))
      commands.push_back(Describe(*command));
    std::fputs(CompletionScript(shell_, commands).c_str(), stdout);
    return ExitCode::kOk;
  }

 private:
  const CLI::App* app_ = nullptr;
  Shell shell_ = Shell::kBash;
};

}  // namespace

std::unique_ptr<Command> MakeCompletionCommand() {
  return std::make_unique<CompletionCommandLine>();
}

}  // namespace sheaf::cli
