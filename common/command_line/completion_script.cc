// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/command_line/completion_script.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

namespace sheaf {
namespace {

// Makes text safe between single quotes in all three shells: it removes quotes and replaces line
// ends, brackets and colons.
std::string Plain(const std::string& text) {
  return absl::StrReplaceAll(text, {{"'", ""}, {"\n", " "}, {"[", "("}, {"]", ")"}, {":", ","}});
}

// The name of the program's function: "_sheaf_worker".
std::string FunctionName(const CompletionProgram& program) {
  return absl::StrCat("_", absl::StrReplaceAll(program.name, {{"-", "_"}}));
}

std::string Names(const std::vector<CompletionCommand>& commands, const char* separator) {
  return absl::StrJoin(commands, separator, [](std::string* out, const CompletionCommand& command) {
    absl::StrAppend(out, command.name);
  });
}

std::string Names(const std::vector<CompletionOption>& options) {
  return absl::StrJoin(options, " ", [](std::string* out, const CompletionOption& option) {
    absl::StrAppend(out, option.name);
  });
}

// The patterns of a command's options that accept a few words.
std::string BashValues(const std::string& command, const std::vector<CompletionOption>& options) {
  std::string values;
  for (const CompletionOption& option : options) {
    if (option.choices.empty() && option.listed.empty()) continue;
    const bool is_list = !option.listed.empty();
    absl::StrAppend(&values, "    ", command, ":", option.name, ") words='",
                    absl::StrJoin(is_list ? option.listed : option.choices, " "), "'",
                    is_list ? " list=yes" : "", " ;;\n");
  }
  return values;
}

std::string BashScript(const CompletionProgram& program) {
  std::string options = absl::StrCat("      '') words='", Names(program.options), "' ;;\n");
  std::string values = BashValues("", program.options), arguments;
  for (const CompletionCommand& command : program.commands) {
    absl::StrAppend(&options, "      ", command.name, ") words='", Names(command.options),
                    "' ;;\n");
    absl::StrAppend(&values, BashValues(command.name, command.options));
    const std::string words = command.takes_job ? absl::StrCat("$(", program.job_names_command, ")")
                                                : absl::StrJoin(command.choices, " ");
    if (words.empty()) continue;
    absl::StrAppend(&arguments, "      ", command.name, ") words=\"", words, "\" ;;\n");
  }
  const std::string names = Names(program.commands, " ");
  const std::string function = FunctionName(program);
  return absl::StrCat(function,
                      "() {\n"
                      "  local word=\"${COMP_WORDS[COMP_CWORD]}\" words=\"\" command=\"\"\n"
                      "  local before=\"${COMP_WORDS[COMP_CWORD-1]}\" list=\"\" first=\"\"\n"
                      "  COMPREPLY=()\n"
                      // bash takes the = of --option=value for a word of its own.
                      "  if [ \"$word\" = '=' ]; then\n"
                      "    word=''\n"
                      "  elif [ \"$before\" = '=' ]; then\n"
                      "    before=\"${COMP_WORDS[COMP_CWORD-2]}\"\n"
                      "  fi\n",
                      program.commands.empty()
                          ? ""
                          : absl::StrCat("  if [ \"$COMP_CWORD\" -gt 1 ]; then\n"
                                         "    case \"${COMP_WORDS[1]}\" in ",
                                         Names(program.commands, "|"),
                                         ") command=\"${COMP_WORDS[1]}\" ;; esac\n"
                                         "  fi\n"),
                      "  case \"$command:$before\" in\n", values,
                      "  esac\n"
                      "  if [ -n \"$words\" ]; then\n"
                      "    :\n"
                      "  elif [[ \"$word\" == -* ]]; then\n"
                      "    case \"$command\" in\n",
                      options,
                      "    esac\n"
                      "  elif [ \"$COMP_CWORD\" -eq 1 ]; then\n"
                      "    words='",
                      names,
                      "'\n"
                      "  elif [ \"$COMP_CWORD\" -eq 2 ]; then\n"
                      "    case \"$command\" in\n",
                      arguments,
                      "    esac\n"
                      "  fi\n"
                      "  if [ -n \"$list\" ]; then\n"
                      "    [[ \"$word\" == *,* ]] && first=\"${word%,*},\"\n"
                      "    compopt -o nospace 2>/dev/null\n"
                      "  fi\n"
                      "  if [ -n \"$words\" ]; then\n"
                      "    mapfile -t COMPREPLY < <(compgen -P \"$first\" -W \"$words\" -- "
                      "\"${word#\"$first\"}\")\n"
                      "  fi\n"
                      "}\n"
                      "complete -o default -F ",
                      function, " ", program.name, "\n");
}

std::string ZshWords(const std::vector<std::string>& choices) {
  return choices.empty() ? "_files" : absl::StrCat("(", absl::StrJoin(choices, " "), ")");
}

std::string ZshValue(const CompletionOption& option) {
  if (option.listed.empty()) return ZshWords(option.choices);
  return absl::StrCat("_values -s , value ", absl::StrJoin(option.listed, " "));
}

std::string ZshOptions(const std::vector<CompletionOption>& options) {
  std::string text;
  for (const CompletionOption& option : options) {
    // With "=", zsh completes --option=value as well.
    absl::StrAppend(&text, " '", option.name, option.takes_value ? "=" : "", "[",
                    Plain(option.help), "]", option.takes_value ? ":value:" + ZshValue(option) : "",
                    "'");
  }
  return text;
}

std::string ZshJobNames(const CompletionProgram& program) {
  if (program.job_names_command.empty()) return "";
  return absl::StrCat(FunctionName(program),
                      "_jobs() {\n"
                      "  local -a jobs\n"
                      "  jobs=(${(f)\"$(",
                      program.job_names_command,
                      ")\"})\n"
                      "  compadd -a jobs\n"
                      "}\n");
}

// Completes the command's name, then what it takes.
std::string ZshCommands(const CompletionProgram& program) {
  std::string script =
      "  local -a commands\n"
      "  commands=(\n";
  for (const CompletionCommand& command : program.commands) {
    absl::StrAppend(&script, "    '", command.name, ":", Plain(command.help), "'\n");
  }
  absl::StrAppend(&script,
                  "  )\n"
                  "  if (( CURRENT == 2 )) && [[ \"${words[2]}\" != -* ]]; then\n"
                  "    _describe command commands\n"
                  "    return\n"
                  "  fi\n"
                  "  case \"${words[2]}\" in\n");
  for (const CompletionCommand& command : program.commands) {
    absl::StrAppend(
        &script, "    ", command.name, ") _arguments", ZshOptions(command.options), " '*:argument:",
        command.takes_job ? FunctionName(program) + "_jobs" : ZshWords(command.choices), "' ;;\n");
  }
  absl::StrAppend(&script, "    *) _arguments", ZshOptions(program.options), " ;;\n  esac\n");
  return script;
}

std::string ZshScript(const CompletionProgram& program) {
  const std::string function = FunctionName(program);
  return absl::StrCat("#compdef ", program.name, "\n", ZshJobNames(program), function, "() {\n",
                      program.commands.empty()
                          ? absl::StrCat("  _arguments", ZshOptions(program.options), "\n")
                          : ZshCommands(program),
                      "}\n"
                      // Loaded by the shell at the first completion, or read by the user.
                      "if [[ \"${funcstack[1]}\" == _",
                      program.name, " ]]; then\n  ", function, " \"$@\"\nelse\n  compdef ",
                      function, " ", program.name, "\nfi\n");
}

std::string FishValues(const CompletionOption& option) {
  if (!option.listed.empty()) {
    return absl::StrCat(" -f -a '(__fish_append , ", absl::StrJoin(option.listed, " "), ")'");
  }
  return option.choices.empty() ? ""
                                : absl::StrCat(" -f -a '", absl::StrJoin(option.choices, " "), "'");
}

std::string FishOptions(const std::string& when, const std::vector<CompletionOption>& options) {
  std::string script;
  for (const CompletionOption& option : options) {
    absl::StrAppend(&script, when, " -l ", option.name.substr(2), option.takes_value ? " -r" : "",
                    FishValues(option), " -d '", Plain(option.help), "'\n");
  }
  return script;
}

std::string FishScript(const CompletionProgram& program) {
  const std::string complete = absl::StrCat("complete -c ", program.name);
  if (program.commands.empty()) return FishOptions(complete, program.options);
  const std::string first = absl::StrCat(complete, " -n __fish_use_subcommand");
  std::string script = FishOptions(first, program.options);
  for (const CompletionCommand& command : program.commands) {
    absl::StrAppend(&script, first, " -f -a ", command.name, " -d '", Plain(command.help), "'\n");
    const std::string when =
        absl::StrCat(complete, " -n '__fish_seen_subcommand_from ", command.name, "'");
    if (command.takes_job || !command.choices.empty()) {
      absl::StrAppend(&script, when, " -f -a '",
                      command.takes_job ? absl::StrCat("(", program.job_names_command, ")")
                                        : absl::StrJoin(command.choices, " "),
                      "'\n");
    }
    absl::StrAppend(&script, FishOptions(when, command.options));
  }
  return script;
}

}  // namespace

std::string CompletionScript(Shell shell, const CompletionProgram& program) {
  switch (shell) {
    case Shell::kBash:
      return BashScript(program);
    case Shell::kZsh:
      return ZshScript(program);
    case Shell::kFish:
      return FishScript(program);
  }
  return "";
}

}  // namespace sheaf
