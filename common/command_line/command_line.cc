// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/command_line/command_line.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/base/printable.h"
#include "common/command_line/name_hint.h"

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

template <typename Kind>
bool IsAbout(const CLI::ParseError& error) {
  return dynamic_cast<const Kind*>(&error) != nullptr;
}

// Says in words the library's errors on options that the command has.
std::string ExplainValue(const CLI::App& command, const CLI::ParseError& error) {
  const std::string text = error.what();
  const auto found = [&command](const std::string& name) {
    return command.get_option_no_throw(name);
  };
  if (IsAbout<CLI::RequiredError>(error)) {
    const CLI::Option* option = found(text.substr(0, text.find(' ')));
    if (option == nullptr) return text;
    return absl::StrCat(option->get_name(), " is missing (", option->get_description(), ")");
  }
  if (IsAbout<CLI::RequiresError>(error)) return text + "; give both";
  if (IsAbout<CLI::ArgumentMismatch>(error)) {
    const CLI::Option* option = found(text.substr(0, text.find(':')));
    if (option == nullptr) return text;
    if (option->count() > 1) {
      return absl::StrCat(option->get_name(), " is given ", option->count(),
                          " times; give it once");
    }
    return absl::StrCat(option->get_name(), ": the value is missing; write ", option->get_name(),
                        " ", ValueName(*option));
  }
  if (IsAbout<CLI::ConversionError>(error)) {
    // "Could not convert: NAME = VALUE".
    const size_t colon = text.find(": "), equals = text.find(" = ");
    if (equals == std::string::npos) return text;
    const std::string name = text.substr(colon + 2, equals - colon - 2);
    const CLI::Option* option = found(name);
    if (option != nullptr && option->get_items_expected_max() == 0) {
      return absl::StrCat(name, " takes no value; write it alone");
    }
    const bool is_whole =
        option != nullptr && option->get_type_name().find("INT") != std::string::npos;
    return absl::StrCat(name, ": \"", text.substr(equals + 3), "\" is not a ",
                        is_whole ? "whole " : "", "number, or too large");
  }
  return text;
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
    return absl::StrCat("unknown option ", name, NameHint(name, OptionNames(command)));
  }
  const bool lacks_command = &command == &app && !app.get_subcommands({}).empty();
  if (lacks_command && (!left.empty() || IsAbout<CLI::RequiredError>(error))) {
    std::vector<std::string> names;
    for (const CLI::App* known : app.get_subcommands({})) names.push_back(known->get_name());
    if (left.empty())
      return absl::StrCat("a command is missing; the commands are ", absl::StrJoin(names, ", "));
    return absl::StrCat("unknown command \"", left.front(), "\"", NameHint(left.front(), names));
  }
  if (!left.empty()) return absl::StrCat("\"", left.front(), "\" is an unexpected argument");
  return ExplainValue(command, error);
}

// The factor of "k", "MB" or "GiB"; empty if there is none.
std::optional<uint64_t> BytesOf(std::string unit) {
  absl::AsciiStrToLower(&unit);
  if (unit.ends_with('b')) unit.pop_back();
  if (unit.size() == 2 && unit[1] == 'i') unit.pop_back();
  if (unit.empty()) return 1;
  const size_t power = unit.size() == 1 ? absl::string_view("kmgtpe").find(unit[0]) : 6;
  if (power >= 6) return std::nullopt;
  return uint64_t{1} << (10 * (power + 1));
}

// The number of bytes in "512M"; empty if there is none or it does not fit.
std::optional<uint64_t> ParseBytes(absl::string_view text) {
  text = absl::StripAsciiWhitespace(text);
  const size_t unit_begin = std::min(text.find_first_not_of("0123456789"), text.size());
  uint64_t count = 0;
  const std::optional<uint64_t> factor =
      BytesOf(std::string(absl::StripAsciiWhitespace(text.substr(unit_begin))));
  if (!absl::SimpleAtoi(text.substr(0, unit_begin), &count) || !factor) return std::nullopt;
  if (count > std::numeric_limits<uint64_t>::max() / *factor) return std::nullopt;
  return count * *factor;
}

// A transformation: drops leading zeros, as the argument library reads "010" as 8.
CLI::Validator AsDecimal() {
  return CLI::Validator(
      [](std::string& text) -> std::string {
        uint64_t count = 0;
        if (absl::SimpleAtoi(text, &count)) text = absl::StrCat(count);
        return "";
      },
      "");
}
// The argument library would read "0x10" as 16, and "-1" as the largest count.
CLI::Validator IsDecimal(bool is_signed) {
  return CLI::Validator(
      [is_signed](const std::string& text) -> std::string {
        uint64_t count = 0;
        int64_t value = 0;
        if (absl::SimpleAtoi(text, &count)) return "";
        if (!absl::SimpleAtoi(text, &value)) {
          return absl::StrCat("\"", Printable(text), "\" is not a whole number, or too large");
        }
        return is_signed ? "" : absl::StrCat("\"", text, "\" is not a whole number of at least 0");
      },
      "");
}
CLI::Validator IsFiniteNumber() {
  return CLI::Validator(
      [](const std::string& text) -> std::string {
        double value = 0;
        if (absl::SimpleAtod(text, &value) && std::isfinite(value)) return "";
        return absl::StrCat("\"", Printable(text), "\" is not a number, or too large");
      },
      "");
}

// Checks the numbers of all options before the argument library converts them.
void CheckNumbers(CLI::App* app) {
  for (CLI::Option* option : app->get_options()) {
    const std::string notation = Notation(*option), type = notation.substr(0, notation.find(':'));
    if (notation.find(":SIZE") != std::string::npos) continue;
    if (type == "UINT" || type == "INT") {
      option->transform(AsDecimal())->check(IsDecimal(type == "INT"));
    } else if (type == "FLOAT") {
      option->check(IsFiniteNumber());
    }
  }
  for (CLI::App* command : app->get_subcommands({})) CheckNumbers(command);
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

CLI::Validator IsOneOf(std::vector<std::string> words) {
  const std::string notation = absl::StrCat("{", absl::StrJoin(words, ","), "}");
  return CLI::Validator(
      [words = std::move(words)](const std::string& text) -> std::string {
        if (std::find(words.begin(), words.end(), text) != words.end()) return "";
        return absl::StrCat("\"", Printable(text), "\" is not one of ", absl::StrJoin(words, ", "),
                            NameHint(text, words));
      },
      notation);
}

CLI::Validator IsFile() {
  return CLI::Validator(
      [](const std::string& name) -> std::string {
        std::error_code error;
        if (std::filesystem::is_directory(name, error)) {
          return absl::StrCat("\"", Printable(name), "\" is a directory; name a file in it");
        }
        if (::access(name.c_str(), R_OK) == 0) return "";
        return absl::StrCat("file \"", Printable(name),
                            "\" cannot be read: ", std::generic_category().message(errno));
      },
      "FILE");
}

CLI::Validator AsBytes() {
  return CLI::Validator(
      [](std::string& text) -> std::string {
        const std::optional<uint64_t> bytes = ParseBytes(text);
        if (!bytes) {
          return absl::StrCat("\"", Printable(text),
                              "\" is not a size below 16E; write bytes, or "
                              "a whole number with its unit, as in 512M or 20G");
        }
        text = absl::StrCat(*bytes);
        return "";
      },
      "SIZE");
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
                                    NameHint(text, words)));
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
    words = words.substr(begin + 1, end - begin - 1);  // The format of IsOneOf's description.
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
  CheckNumbers(app);
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
