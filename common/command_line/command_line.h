// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Common command line handling of all programs: help without the argument library's notation, and
// errors that suggest the intended word.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace sheaf {

inline constexpr int kUsageExitCode = 2;

// The placeholder for an option's value in help: "auto|rgb|spectral", "N", "FILE", "SIZE"; empty
// for flags.
std::string ValueName(const CLI::Option& option);
// The words that the option accepts, if they are few; for completion.
std::vector<std::string> ChoicesOf(const CLI::Option& option);

// The words of an option made by AddList; empty for others.
std::vector<std::string> ListedWordsOf(const CLI::Option& option);

// Limit of a text that goes to the coordinator: it is refused unless it is printable UTF-8 and has
// at most this many bytes.
inline constexpr size_t kNameBytesMax = 300;
CLI::Validator IsText(size_t bytes_max = kNameBytesMax);

// Refuses, in words, all but numbers from min to max; the integer forms, all but whole ones.
CLI::Validator InRange(int64_t min, int64_t max = std::numeric_limits<int64_t>::max());
CLI::Validator InRange(int min, int max);
CLI::Validator InRange(double min, double max = std::numeric_limits<double>::infinity());

// Refuses all but these words.
CLI::Validator IsOneOf(std::vector<std::string> words);

// Refuses all but names of files that can be read.
CLI::Validator IsFile();

// A transformation: makes "512M" or "20G" the number of bytes, by powers of 1024.
CLI::Validator AsBytes();

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

// An option that accepts one of a few words, ignoring case. on_choice(i): called with the index of
// the word.
CLI::Option* AddChoiceOf(CLI::App* command, const std::string& names,
                         std::vector<std::string> words, std::function<void(size_t)> on_choice,
                         const std::string& help);

// The same where each word has its value.
template <typename Target, typename Value>
CLI::Option* AddChoice(CLI::App* command, const std::string& names, Target* target,
                       std::vector<std::pair<std::string, Value>> choices,
                       const std::string& help) {
  std::vector<std::string> words;
  for (const auto& [word, value] : choices) words.push_back(word);
  return AddChoiceOf(
      command, names, std::move(words),
      [target, choices = std::move(choices)](size_t i) { *target = choices[i].second; }, help);
}

// An option that accepts a list of words, separated by commas. help: its beginning, which the words
// follow; after: its end.
CLI::Option* AddList(CLI::App* command, const std::string& names,
                     const std::vector<std::string>& words,
                     std::function<void(const std::string&)> on_text, const std::string& help,
                     const std::string& after = "");

// Parses the command line. Returns the exit code if the program should end: after printing help or
// the version, or after passing a one-line error to on_error.
std::optional<int> ParseCommandLine(CLI::App* app, int argc, char** argv,
                                    const std::function<void(const std::string&)>& on_error);

}  // namespace sheaf
