// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/completion_script.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

namespace sheaf::cli {
namespace {

// Makes text safe between single quotes in all three shells: it removes quotes and replaces line
// ends, brackets and colons.
std::string Plain(const std::string& text) {
  return absl::StrReplaceAll(text, {{"'", ""}, {"\n", " "}, {"[", "("}, {"]", ")"}, {":", ","}});
}

std::string Names(const std::vector<CompletionCommand>& commands) {
  std::string names;
  for (const CompletionCommand& command : commands) {
    absl::StrAppend(&names, names.empty() ? "" : " ", command.name);
  }
  return names;
}

// The words that complete a command's argument.
std::string BashWords(const CompletionCommand& command) {
  return command.takes_job ? absl::StrCat("$(", kJobNamesCommand, ")")
                           : absl::StrJoin(command.choices, " ");
}

std::string BashScript(const std::vector<CompletionCommand>& commands) {
  std::string options, values, arguments;
  for (const CompletionCommand& command : commands) {
    absl::StrAppend(&options, "      ", command.name, ") words='");
    for (size_t i = 0; i < command.options.size(); ++i) {
      const CompletionOption& option = command.options[i];
      absl::StrAppend(&options, i == 0 ? "" : " ", option.name);
      if (option.choices.empty()) continue;
      absl::StrAppend(&values, "    ", command.name, ":", option.name, ") words='",
                      absl::StrJoin(option.choices, " "), "' ;;\n");
    }
    absl::StrAppend(&options, "' ;;\n");
    if (const std::string words = BashWords(command); !words.empty()) {
      absl::StrAppend(&arguments, "      ", command.name, ") words=\"", words, "\" ;;\n");
    }
  }
  return absl::StrCat(
      "_sheaf() {\n"
      "  local word=\"${COMP_WORDS[COMP_CWORD]}\" words=\"\"\n"
      "  COMPREPLY=()\n"
      "  case \"${COMP_WORDS[1]}:${COMP_WORDS[COMP_CWORD-1]}\" in\n",
      values,
      "  esac\n"
      "  if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
      "    words='",
      Names(commands),
      "'\n"
      "  elif [[ \"$word\" == -* ]]; then\n"
      "    case \"${COMP_WORDS[1]}\" in\n",
      options,
      "    esac\n"
      "  elif [ \"$COMP_CWORD\" -eq 2 ]; then\n"
      "    case \"${COMP_WORDS[1]}\" in\n",
      arguments,
      "    esac\n"
      "  fi\n"
      "  if [ -n \"$words\" ]; then\n"
      "    mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$word\")\n"
      "  fi\n"
      "}\n"
      "complete -o default -F _sheaf sheaf\n");
}

std::string ZshScript(const std::vector<CompletionCommand>& commands) {
  std::string script = absl::StrCat(
      "#compdef sheaf\n"
      "_sheaf_jobs() {\n"
      "  local -a jobs\n"
      "  jobs=(${(f)\"$(",
      kJobNamesCommand,
      ")\"})\n"
      "  compadd -a jobs\n"
      "}\n"
      "_sheaf() {\n"
      "  local -a commands\n"
      "  commands=(\n");
  for (const CompletionCommand& command : commands) {
    absl::StrAppend(&script, "    '", command.name, ":", Plain(command.help), "'\n");
  }
  absl::StrAppend(&script,
                  "  )\n"
                  "  if (( CURRENT == 2 )); then\n"
                  "    _describe command commands\n"
                  "    return\n"
                  "  fi\n"
                  "  case \"${words[2]}\" in\n");
  const auto words = [](const std::vector<std::string>& choices) {
    return choices.empty() ? "_files" : absl::StrCat("(", absl::StrJoin(choices, " "), ")");
  };
  for (const CompletionCommand& command : commands) {
    absl::StrAppend(&script, "    ", command.name, ") _arguments");
    for (const CompletionOption& option : command.options) {
      absl::StrAppend(&script, " '", option.name, "[", Plain(option.help), "]",
                      option.takes_value ? ":value:" + words(option.choices) : "", "'");
    }
    absl::StrAppend(&script,
                    " '*:argument:", command.takes_job ? "_sheaf_jobs" : words(command.choices),
                    "' ;;\n");
  }
  absl::StrAppend(&script, "  esac\n}\ncompdef _sheaf sheaf\n");
  return script;
}

std::string FishScript(const std::vector<CompletionCommand>& commands) {
  std::string script;
  for (const CompletionCommand& command : commands) {
    absl::StrAppend(&script, "complete -c sheaf -n __fish_use_subcommand -f -a ", command.name,
                    " -d '", Plain(command.help), "'\n");
    const std::string when =
        absl::StrCat("complete -c sheaf -n '__fish_seen_subcommand_from ", command.name, "'");
    if (command.takes_job || !command.choices.empty()) {
      absl::StrAppend(&script, when, " -f -a '",
                      command.takes_job ? absl::StrCat("(", kJobNamesCommand, ")")
                                        : absl::StrJoin(command.choices, " "),
                      "'\n");
    }
    for (const CompletionOption& option : command.options) {
      absl::StrAppend(&script, when, " -l ", option.name.substr(2), option.takes_value ? " -r" : "",
                      option.choices.empty()
                          ? ""
                          : absl::StrCat(" -f -a '", absl::StrJoin(option.choices, " "), "'"),
                      " -d '", Plain(option.help), "'\n");
    }
  }
  return script;
}

}  // namespace

std::string CompletionScript(Shell shell, const std::vector<CompletionCommand>& commands) {
  switch (shell) {
    case Shell::kBash:
      return BashScript(commands);
    case Shell::kZsh:
      return ZshScript(commands);
    case Shell::kFish:
      return FishScript(commands);
  }
  return "";
}

}  // namespace sheaf::cli
