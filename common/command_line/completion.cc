// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/command_line/completion.h"

namespace sheaf {
namespace {

CompletionCommand DescribeCommand(const CLI::App& command) {
  CompletionCommand description{command.get_name(), command.get_description(), {}};
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_positional()) {
      description.choices = ChoicesOf(*option);
      description.takes_job = option->get_name() == "JOB";
    }
    for (const std::string& name : option->get_lnames()) {
      description.options.push_back({"--" + name, option->get_description(),
                                     option->get_items_expected_max() > 0, ChoicesOf(*option),
                                     ListedWordsOf(*option)});
    }
  }
  return description;
}

}  // namespace

CompletionProgram DescribeProgram(const CLI::App& app, const std::string& job_names_command) {
  CompletionProgram program{app.get_name(), DescribeCommand(app).options, {}, job_names_command};
  for (const CLI::App* command : app.get_subcommands({})) {
    program.commands.push_back(DescribeCommand(*command));
  }
  return program;
}

void AddCompletionOption(CLI::App* app) {
  const std::vector<std::string> words = {"bash", "zsh", "fish"};
  AddChoiceOf(
      app, "--completion", words,
      [app](size_t shell) {
        // Ends the parsing as --version does, which prints its text.
        throw CLI::CallForVersion(
            CompletionScript(static_cast<Shell>(shell), DescribeProgram(*app, "")), 0);
      },
      "Print a completion script for a shell and exit")
      ->trigger_on_parse();
}

}  // namespace sheaf
