// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/own_command.h"

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/base/text/shell_quoted.h"

namespace sheaf::cli {
namespace {

constexpr char kUsersCommand[] = "--denoise-with";

std::string& Kept() {
  static auto* const kText = new std::string;
  return *kText;
}

}  // namespace

std::string CommandText(const std::vector<std::string>& words) {
  std::string text = "sheaf";
  bool is_left_out = false;
  for (const std::string& word : words) {
    const bool is_value = is_left_out;
    is_left_out = word == kUsersCommand;
    const bool is_option = is_left_out || absl::StartsWith(word, absl::StrCat(kUsersCommand, "="));
    if (!is_value && !is_option) absl::StrAppend(&text, " ", ShellQuoted(word));
  }
  return text;
}

void NoteOwnCommand(int argc, char** argv) {
  if (argc > 0) Kept() = CommandText({argv + 1, argv + argc});
}

const std::string& OwnCommand() { return Kept(); }

}  // namespace sheaf::cli
