// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary lines as the arguments of a command that has all options of jobs, and arbitrary
// text as a range of frames.
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_split.h"
#include "cli/commands/options.h"
#include "cli/job/frames/frame_range.h"
#include "common/command_line/command_line.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf::cli {
namespace {

void Parse(std::vector<std::string> words) {
  JobArguments arguments;
  FarmAddress coordinator;
  CLI::App app;
  AddJobOptions(&app, &arguments);
  AddCoordinatorOption(&app, &coordinator);
  words.insert(words.begin(), "sheaf");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  std::string error;
  const std::optional<int> code =
      ParseCommandLine(&app, static_cast<int>(argv.size()), argv.data(),
                       [&error](const std::string& message) { error = message; });
  if (code == kUsageExitCode) SHEAF_CHECK(!error.empty());
  if (code) return;
  const StopArguments& stop = arguments.stop;
  SHEAF_CHECK(stop.target_error >= 0 && stop.seconds >= 0 && stop.budget_cpu_hours >= 0);
  if (arguments.settings.crop) SHEAF_CHECK(!arguments.settings.crop->IsEmpty());
}

}  // namespace

SHEAF_FUZZ_TARGET(command_line) {
  const std::string text(bytes);
  const absl::StatusOr<std::vector<int32_t>> frames = ParseFrameRange(text);
  if (frames.ok()) SHEAF_CHECK(!frames->empty() && frames->size() <= kFramesMax);
  std::vector<std::string> words;
  for (const std::string& line : std::vector<std::string>(absl::StrSplit(text, '\n'))) {
    words.push_back(line.substr(0, line.find('\0')));
    if (words.back() == "-h" || words.back() == "--help") return;  // Prints pages.
  }
  Parse(std::move(words));
}

}  // namespace sheaf::cli
