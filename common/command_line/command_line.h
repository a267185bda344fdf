// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Common command line handling of all programs: help without the argument library's notation, and
// errors that suggest the intended word.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/nearest_name.h"

namespace sheaf {

inline constexpr int kUsageExitCode = 2;

// The placeholder for an option's value in help: "auto|rgb|spectral", "N", "FILE", "SIZE"; empty
// for flags.
std::string ValueName(const CLI::Option& option);
// The words that the option accepts, if they are few; for completion.
std::vector<std::string> ChoicesOf(const CLI::Option& option);

// Options added during its lifetime appear under that heading in help.
class OptionGroup {
 public:
  OptionGroup(CLI::App* command, const std::string& heading)
      : command_(command), before_(command->option_defaults()->get_group()) {
    command_->option_defaults()->group(heading);
  }
  ~OptionGroup() { command_->option_defaults()->group(before_); }
  OptionGroup(const OptionGroup&) = delete;
  OptionGroup& operator=(const OptionGroup&) = delete;

 private:
  CLI::App* const command_;
  const std::string before_;
};

// An option that accepts one of a few words, ignoring case, each with its value.
template <typename Target, typename Value>
CLI::Option* AddChoice(CLI::App* command, const std::string& names, Target* target,
                       std::vector<std::pair<std::string, Value>> choices,
                       const std::string& help) {
  std::vector<std::string> words;
  for (const auto& [word, value] : choices) words.push_back(word);
  return command
      ->add_option_function<std::string>(
          names,
          [names, target, choices, words](const std::string& text) {
            for (const auto& [word, value] : choices) {
              if (!absl::EqualsIgnoreCase(word, text)) continue;
              *target = value;
              return;
            }
            throw CLI::ValidationError(
                names, absl::StrCat("\"", text, "\" is not one of ", absl::StrJoin(words, ", "),
                                    NearestNameHint(text, words)));
          },
          help)
      ->type_name(absl::StrJoin(words, "|"));
}

// Parses the command line. Returns the exit code if the program should end: after printing help or
// the version, or after passing a one-line error to on_error.
std::optional<int> ParseCommandLine(CLI::App* app, int argc, char** argv,
                                    const std::function<void(const std::string&)>& on_error);

}  // namespace sheaf
