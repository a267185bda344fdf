// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/stop_options.h"

#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "cli/commands/error_option.h"
#include "common/command_line/command_line.h"

namespace sheaf::cli {
namespace {

constexpr double kStopNumberMax = 1e6;

// Written so that NaN is refused too.
std::string CheckPositive(const std::string& text) {
  double value = 0;
  if (absl::SimpleAtod(text, &value) && value > 0 && value <= kStopNumberMax) return "";
  return absl::StrCat("\"", text, "\" is not a number above 0 and at most ", kStopNumberMax);
}

// Parses "90s", "10m", "1h30m".
double ParseSeconds(const std::string& text) {
  absl::Duration duration;
  if (!absl::ParseDuration(text, &duration) || duration <= absl::ZeroDuration() ||
      duration == absl::InfiniteDuration()) {
    throw CLI::ValidationError("--time",
                               text + ": expected a time with its unit, as in 90s, 10m or 1h30m");
  }
  return absl::ToDoubleSeconds(duration);
}

}  // namespace

void AddStopOptions(CLI::App* command, StopArguments* stop) {
  const OptionGroup group(command, "When to stop");
  CLI::Option* const target =
      command
          ->add_option("--target-error", stop->target_error,
                       "Stop when the typical error of a pixel is at most this, e.g. 5%, with 95 % "
                       "confidence; a number without % is relMSE, the square (0.0025). Sampling is "
                       "adaptive, with at most --samples per pixel (65536)")
          ->transform(PercentAsRelativeMse())
          ->check(CheckPositive);
  command
      ->add_flag("--certified", stop->certified,
                 "Compare --target-error with a bound that holds for any scene, not with the "
                 "estimate; all pixels get the same samples. Needs --clamp and --color rgb")
      ->needs(target);
  command->add_option_function<std::string>(
      "--time", [stop](const std::string& text) { stop->seconds = ParseSeconds(text); },
      "Stop before a frame has taken this long, e.g. 90s, 10m or 1h30m");
  command
      ->add_option("--budget", stop->budget_cpu_hours,
                   "Stop before the job has taken this many CPU hours; each frame has an equal "
                   "share")
      ->check(CheckPositive);
}

}  // namespace sheaf::cli
