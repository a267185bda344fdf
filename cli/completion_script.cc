// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/completion_script.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace sheaf::cli {
namespace {

// For text between single quotes in any of the three shells: quotes are left out.
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

std::string BashScript(const std::vector<CompletionCommand>& commands) {
  std::string script = absl::StrCat(
      "_sheaf() {\n"
      "  local word=\"${COMP_WORDS[COMP_CWORD]}\" words=\"\"\n"
      "  COMPREPLY=()\n"
      "  if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
      "    words='",
      Names(commands),
      "'\n"
      "  elif [[ \"$word\" == -* ]]; then\n"
      "    case \"${COMP_WORDS[1]}\" in\n");
  for (const CompletionCommand& command : commands) {
    absl::StrAppend(&script, "      ", command.name, ") words='");
    for (size_t i = 0; i < command.options.size(); ++i) {
      absl::StrAppend(&script, i == 0 ? "" : " ", command.options[i].name);
    }
    absl::StrAppend(&script, "' ;;\n");
  }
  absl::StrAppend(&script,
                  "    esac\n"
                  "  fi\n"
                  "  if [ -n \"$words\" ]; then\n"
                  "    mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$word\")\n"
                  "  fi\n"
                  "}\n"
                  "complete -o default -F _sheaf sheaf\n");
  return script;
}

std::string ZshScript(const std::vector<CompletionCommand>& commands) {
  std::string script =
      "#compdef sheaf\n"
      "_sheaf() {\n"
      "  local -a commands\n"
      "  commands=(\n";
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
  for (const CompletionCommand& command : commands) {
    absl::StrAppend(&script, "    ", command.name, ") _arguments");
    for (const CompletionOption& option : command.options) {
      absl::StrAppend(&script, " '", option.name, "[", Plain(option.help), "]",
                      option.takes_value ? ":value:_files" : "", "'");
    }
    absl::StrAppend(&script, " '*:file:_files' ;;\n");
  }
  absl::StrAppend(&script, "  esac\n}\ncompdef _sheaf sheaf\n");
  return script;
}

std::string FishScript(const std::vector<CompletionCommand>& commands) {
  std::string script;
  for (const CompletionCommand& command : commands) {
    absl::StrAppend(&script, "complete -c sheaf -n __fish_use_subcommand -f -a ", command.name,
                    " -d '", Plain(command.help), "'\n");
    for (const CompletionOption& option : command.options) {
      absl::StrAppend(&script, "complete -c sheaf -n '__fish_seen_subcommand_from ", command.name,
                      "' -l ", option.name.substr(2), option.takes_value ? " -r" : "", " -d '",
                      Plain(option.help), "'\n");
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
