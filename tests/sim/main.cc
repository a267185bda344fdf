// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// farm_sim: simulates farms from seeds and says which of them broke a promise.
// Exit codes: 0 all is right; 1 a seed failed, with the command that shows it; 2 wrong usage.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/base/log.h"
#include "common/command_line/command_line.h"
#include "tests/sim/runner.h"

namespace sheaf::sim {
namespace {

constexpr size_t kTraceLinesShown = 40;

struct CommandLine {
  std::string seeds = "1-200";
  uint64_t steps = 600;
  int jobs = 1;
  size_t failed_max = 1;
  std::vector<std::string> without;
  bool trace = false;
  bool shorten = true;
};

void AddOptions(CommandLine* line, CLI::App* app) {
  app->add_option("--seeds,--seed", line->seeds, "The seeds to run: A-B, or one")
      ->capture_default_str();
  app->add_option("--steps", line->steps,
                  "Events with faults, of each seed; then the farm must end")
      ->capture_default_str();
  app->add_option("--jobs", line->jobs, "Processes at a time")
      ->check(InRange(1, 64))
      ->capture_default_str();
  app->add_option("--failures", line->failed_max, "End when this many seeds have failed")
      ->check(InRange(int64_t{1}, static_cast<int64_t>(kFailedSeedsMax)))
      ->capture_default_str();
  app->add_option("--without", line->without, "Kinds of faults to leave out, with commas")
      ->delimiter(',');
  app->add_flag("--trace", line->trace, "Tell what happens, to standard error; of one seed");
  app->add_flag("!--no-shorten", line->shorten, "Do not look for a shorter run of a failed seed");
}

std::optional<uint32_t> FaultsNamed(const std::vector<std::string>& names) {
  uint32_t mask = 0;
  for (const std::string& name : names) {
    size_t kind = 0;
    while (kind < kFaultCount && name != FaultName(static_cast<Fault>(kind))) ++kind;
    if (kind == kFaultCount) return std::nullopt;
    mask |= uint32_t{1} << kind;
  }
  return mask;
}

bool ParseSeeds(const std::string& text, uint64_t* first, uint64_t* last) {
  const std::vector<std::string> ends = absl::StrSplit(text, '-');
  if (ends.size() > 2 || !absl::SimpleAtoi(ends.front(), first)) return false;
  return absl::SimpleAtoi(ends.back(), last) && *first <= *last;
}

std::string CommandOf(const SimulationOptions& options) {
  std::vector<std::string> without;
  for (size_t kind = 0; kind < kFaultCount; ++kind) {
    if ((options.without >> kind & 1) != 0) without.push_back(FaultName(static_cast<Fault>(kind)));
  }
  return absl::StrCat("farm_sim --seed ", options.seed, " --steps ", options.steps,
                      without.empty() ? "" : " --without ", absl::StrJoin(without, ","));
}

void ShowFailure(const FailedSeed& failed, SimulationOptions options, bool shorten) {
  options.seed = failed.seed;
  absl::PrintF("seed %d: %s\n  replay: %s --trace\n", failed.seed, failed.broken,
               CommandOf(options));
  if (!shorten) return;
  options = Shorten(options);
  options.trace = true;
  const IsolatedRun run = RunIsolated(options);
  absl::PrintF("  shorter: %s --trace\n  there: %s\n", CommandOf(options), run.broken);
  const std::vector<std::string> lines = absl::StrSplit(run.output, '\n');
  const size_t shown = std::min(lines.size(), kTraceLinesShown);
  absl::PrintF("  the last of %d lines of its trace:\n", lines.size());
  for (size_t i = lines.size() - shown; i < lines.size(); ++i) {
    absl::PrintF("    %s\n", lines[i]);
  }
}

void PrintSummary(const Totals& totals, double seconds) {
  std::string faults;
  for (size_t kind = 0; kind < kFaultCount; ++kind) {
    absl::StrAppend(&faults, kind == 0 ? "" : ", ", FaultName(static_cast<Fault>(kind)), " ",
                    totals.faults[kind]);
  }
  absl::PrintF(
      "%d seeds, %d steps in %.1f s, %.1f s of CPU time (%.0f steps a CPU second), %d failed; "
      "jobs: %d succeeded, %d failed, %d "
      "cancelled; %d lives of coordinators; %d makers of false parts found, %d images with false "
      "parts that were not found in time; faults: %s\n",
      totals.seed_count, totals.step_count, seconds, totals.cpu_seconds,
      static_cast<double>(totals.step_count) / totals.cpu_seconds, totals.failed.size(),
      totals.jobs_succeeded, totals.jobs_failed, totals.jobs_cancelled, totals.lives,
      totals.liars_found, totals.false_images, faults);
}

int UsageError(const std::string& text) {
  std::fprintf(stderr, "farm_sim: %s\n", text.c_str());
  return kUsageExitCode;
}

int Main(int argc, char** argv) {
  CommandLine line;
  CLI::App app("Simulates render farms from seeds, with faults, and checks what must hold.",
               "farm_sim");
  AddOptions(&line, &app);
  const std::optional<int> exit_code =
      ParseCommandLine(&app, argc, argv, [](const std::string& error) { UsageError(error); });
  if (exit_code) return *exit_code;
  uint64_t first = 0, last = 0;
  if (!ParseSeeds(line.seeds, &first, &last)) {
    return UsageError(absl::StrCat("--seeds ", line.seeds, ": not A-B with A at most B"));
  }
  const std::optional<uint32_t> without = FaultsNamed(line.without);
  if (!without) return UsageError("--without: no such kind of fault; the summary names them all");
  SetLogLevel(LogLevel::kOff);
  SimulationOptions options{first, line.steps, *without, line.trace && first == last};
  if (options.trace) {
    const SimulationResult result = Simulation(options).Run();
    std::printf("%s\n", result.broken.empty() ? "all is right" : result.broken.c_str());
    return result.broken.empty() ? 0 : 1;
  }
  const auto begin = std::chrono::steady_clock::now();
  const Totals totals = RunSeeds(first, last, line.jobs, line.failed_max, options);
  const std::chrono::duration<double> time = std::chrono::steady_clock::now() - begin;
  for (const FailedSeed& failed : totals.failed) ShowFailure(failed, options, line.shorten);
  PrintSummary(totals, time.count());
  return totals.failed.empty() ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::sim

int main(int argc, char** argv) { return sheaf::sim::Main(argc, argv); }
