// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/command_line/command_line.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "common/base/nearest_name.h"
#include "common/base/printable.h"

namespace sheaf {
namespace {

constexpr size_t kHelpColumns = 100;
constexpr size_t kNameColumns = 26;
constexpr char kListed[] = ", separated by commas: ";

// The argument library's description of an option's type: "UINT:INT in [8 - 1024]".
std::string Notation(const CLI::Option& option) {
  return option.get_type_size() == 0 ? "" : option.get_type_name();
}

// "8 to 1024" if the notation contains a range.
std::string RangeOf(const CLI::Option& option) {
  const std::string notation = Notation(option);
  const size_t begin = notation.find(" in ["), end = notation.rfind(']');
  if (begin == std::string::npos || end == std::string::npos) return "";
  return absl::StrReplaceAll(notation.substr(begin + 5, end - begin - 5), {{" - ", " to "}});
}

// The remarks after an option's description.
std::string Remarks(const CLI::Option& option) {
  std::vector<std::string> remarks;
  if (const std::string range = RangeOf(option); !range.empty()) remarks.push_back(range);
  if (!option.get_default_str().empty() && option.get_type_size() != 0) {
    remarks.push_back("default " + option.get_default_str());
  }
  if (!option.get_envname().empty()) remarks.push_back("also from " + option.get_envname());
  return remarks.empty() ? "" : absl::StrCat(" (", absl::StrJoin(remarks, "; "), ")");
}

// The name; choices that do not fit continue in further lines. *column: the length of the last
// line.
std::string HelpName(const std::string& name, size_t* column) {
  constexpr char kIndent[] = "      ";
  std::string lines, line = "  " + name;
  while (line.size() > kHelpColumns) {
    const size_t bar = line.rfind('|', kHelpColumns - 1);
    if (bar == std::string::npos) break;
    absl::StrAppend(&lines, line.substr(0, bar + 1), "\n");
    line = kIndent + line.substr(bar + 1);
  }
  *column = line.size();
  return lines + line;
}

// Two columns; the right one is wrapped.
std::string HelpEntry(const std::string& name, const std::string& text) {
  size_t column = 0;
  std::string entry = HelpName(name, &column);
  const auto start_line = [&] {
    entry += "\n" + std::string(kNameColumns, ' ');
    column = kNameColumns;
  };
  if (column + 2 > kNameColumns) {
    start_line();
  } else {
    entry.append(kNameColumns - column, ' ');
    column = kNameColumns;
  }
  const std::vector<std::string> words =
      absl::StrSplit(text, absl::ByAnyChar(" \n"), absl::SkipEmpty());
  for (const std::string& word : words) {
    if (column > kNameColumns && column + 1 + word.size() > kHelpColumns) start_line();
    if (column > kNameColumns) {
      entry += ' ';
      ++column;
    }
    entry += word;
    column += word.size();
  }
  return entry + "\n";
}

class PlainFormatter : public CLI::Formatter {
 public:
  PlainFormatter() {
    label("SUBCOMMAND", "COMMAND");
    label("Positionals", "Arguments");
  }
  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::string name = make_option_name(option, is_positional);
    name = name.substr(0, name.find('{'));  // The value of a flag that is given without one.
    const std::string value = ValueName(*option);
    if (!is_positional && !value.empty()) absl::StrAppend(&name, " ", value);
    return HelpEntry(absl::StrReplaceAll(name, {{",-", ", -"}}),
                     absl::StrCat(option->get_description(), Remarks(*option)));
  }
  std::string make_subcommand(const CLI::App* command) const override {
    return HelpEntry(command->get_name(), command->get_description());
  }
  std::string make_description(const CLI::App* app) const override {
    return app->get_description() + "\n";
  }
};

const CLI::App& DeepestCommand(const CLI::App& app) {
  const std::vector<CLI::App*> parsed = app.get_subcommands();
  return parsed.empty() ? app : DeepestCommand(*parsed.back());
}

std::string FullName(const CLI::App& app) {
  return app.get_parent() == nullptr ? app.get_name()
                                     : FullName(*app.get_parent()) + " " + app.get_name();
}

std::vector<std::string> OptionNames(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
  }
  return names;
}

std::string Explain(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App& command = DeepestCommand(app);
  const std::vector<std::string> left = app.remaining(/*recurse=*/true);
  const auto option = std::find_if(left.begin(), left.end(),
                                   [](const std::string& text) { return text.starts_with("-"); });
  if (option != left.end()) {
    const std::string name = option->substr(0, option->find('='));
    std::error_code ignored;
    if (std::filesystem::exists(*option, ignored)) {
      return absl::StrCat(*option, ": is read as an option; write the file's name as ./", *option);
    }
    return absl::StrCat("unknown option ", name, NearestNameHint(name, OptionNames(command)));
  }
  if (&command == &app && !app.get_subcommands({}).empty()) {
    std::vector<std::string> names;
    for (const CLI::App* known : app.get_subcommands({})) names.push_back(known->get_name());
    if (left.empty())
      return absl::StrCat("a command is missing; the commands are ", absl::StrJoin(names, ", "));
    return absl::StrCat("unknown command \"", left.front(), "\"",
                        NearestNameHint(left.front(), names));
  }
  if (!left.empty()) return absl::StrCat("\"", left.front(), "\" is an unexpected argument");
  return error.what();
}

}  // namespace

std::string ValueName(const CLI::Option& option) {
  const std::vector<std::string> choices = ChoicesOf(option);
  if (!choices.empty()) return absl::StrJoin(choices, "|");
  const std::string notation = Notation(option);
  const std::string type = notation.substr(0, notation.find(':'));
  if (notation.find(":SIZE") != std::string::npos) return "SIZE";
  if (notation.find(":FILE") != std::string::npos) return "FILE";
  return type == "INT" || type == "UINT" || type == "FLOAT" ? "N" : type;
}

CLI::Validator IsText(size_t bytes_max) {
  return CLI::Validator(
      [bytes_max](const std::string& text) -> std::string {
        const size_t at = FindUnprintable(text);
        if (at != std::string::npos) {
          return absl::StrCat("\"", Printable(text), "\": byte ", at + 1,
                              " is not printable UTF-8; write it in UTF-8");
        }
        if (text.size() > bytes_max) {
          return absl::StrCat("\"", Printable(text, 40), "\": is over ", bytes_max, " bytes");
        }
        return "";
      },
      "");
}

CLI::Validator InRange(int64_t min, int64_t max) {
  const bool is_open = max == std::numeric_limits<int64_t>::max();
  const std::string allowed =
      is_open ? absl::StrCat("of at least ", min) : absl::StrCat("from ", min, " to ", max);
  return CLI::Validator(
      [=](const std::string& text) -> std::string {
        int64_t value = 0;
        if (absl::SimpleAtoi(text, &value) && value >= min && value <= max) return "";
        return absl::StrCat("\"", Printable(text), "\" is not a whole number ", allowed);
      },
      is_open ? "" : absl::StrCat("N in [", min, " - ", max, "]"));
}

CLI::Validator InRange(int min, int max) { return InRange(int64_t{min}, int64_t{max}); }

CLI::Validator InRange(double min, double max) {
  const bool is_open = std::isinf(max);
  const std::string allowed =
      is_open ? absl::StrCat("of at least ", min) : absl::StrCat("from ", min, " to ", max);
  return CLI::Validator(
      [=](const std::string& text) -> std::string {
        double value = 0;
        if (absl::SimpleAtod(text, &value) && value >= min && value <= max) return "";
        return absl::StrCat("\"", Printable(text), "\" is not a number ", allowed);
      },
      is_open ? "" : absl::StrCat("N in [", min, " - ", max, "]"));
}

CLI::Option* AddChoiceOf(CLI::App* command, const std::string& names,
                         std::vector<std::string> words, std::function<void(size_t)> on_choice,
                         const std::string& help) {
  const std::string type = absl::StrJoin(words, "|");
  return command
      ->add_option_function<std::string>(
          names,
          [names, words = std::move(words),
           on_choice = std::move(on_choice)](const std::string& text) {
            for (size_t i = 0; i < words.size(); ++i) {
              if (absl::EqualsIgnoreCase(words[i], text)) return on_choice(i);
            }
            throw CLI::ValidationError(
                names, absl::StrCat("\"", text, "\" is not one of ", absl::StrJoin(words, ", "),
                                    NearestNameHint(text, words)));
          },
          help)
      ->type_name(type);
}

CLI::Option* AddList(CLI::App* command, const std::string& names,
                     const std::vector<std::string>& words,
                     std::function<void(const std::string&)> on_text, const std::string& help,
                     const std::string& after) {
  return command->add_option_function<std::string>(
      names, std::move(on_text), absl::StrCat(help, kListed, absl::StrJoin(words, ", "), after));
}

std::vector<std::string> ListedWordsOf(const CLI::Option& option) {
  const std::string help = option.get_description();
  const size_t at = help.find(kListed);
  if (at == std::string::npos) return {};
  const size_t begin = at + std::strlen(kListed);
  return absl::StrSplit(help.substr(begin, help.find(" (", begin) - begin), ", ");
}

std::vector<std::string> ChoicesOf(const CLI::Option& option) {
  std::string words = Notation(option);
  const size_t begin = words.find('{'), end = words.find('}');
  if (begin != std::string::npos && end != std::string::npos) {
    words = words.substr(begin + 1, end - begin - 1);  // The format of CLI::IsMember's description.
    return absl::StrSplit(words, ',', absl::SkipEmpty());
  }
  if (words.find('|') == std::string::npos) return {};
  return absl::StrSplit(words, '|');
}

std::optional<int> ParseCommandLine(CLI::App* app, int argc, char** argv,
                                    const std::function<void(const std::string&)>& on_error) {
  const auto formatter = std::make_shared<PlainFormatter>();
  app->formatter(formatter);
  for (CLI::App* command : app->get_subcommands({})) command->formatter(formatter);
  try {
    app->parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {
      app->exit(error);
      return 0;
    }
    on_error(Printable(absl::StrCat(Explain(*app, error), "; ", FullName(DeepestCommand(*app)),
                                    " --help shows the usage")));
    return kUsageExitCode;
  }
}

}  // namespace sheaf
