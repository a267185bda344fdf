// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf completion: prints a completion script for a shell, made from sheaf's own option
// definitions.
#include <chrono>
#include <cstdio>
#include <string>
#include <thread>

#include "cli/commands/command.h"
#include "cli/commands/options.h"
#include "cli/job/farm_channel.h"
#include "cli/job/farm_client.h"
#include "common/base/mutex.h"
#include "common/command_line/command_line.h"
#include "common/command_line/completion.h"
#include "common/rpc/address.h"

namespace sheaf::cli {
namespace {

// Short, because the user waits for the completion.
constexpr std::chrono::milliseconds kJobNamesWait{1500};
constexpr size_t kJobNamesMax = 100;
// Prints the names of jobs; nothing if no coordinator answers.
constexpr char kJobNamesCommand[] = "sheaf completion jobs 2>/dev/null";

class CompletionCommandLine : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    app_ = app;
    CLI::App* command = app->add_subcommand("completion", "Print a completion script for a shell");
    AddChoice(command, "SHELL", &wanted_,
              std::vector<std::pair<std::string, Wanted>>{{"bash", Wanted::kBash},
                                                          {"zsh", Wanted::kZsh},
                                                          {"fish", Wanted::kFish},
                                                          {"jobs", Wanted::kJobs}},
              "bash, zsh or fish; jobs prints the names of jobs, which the scripts use")
        ->required();
    AddCoordinatorOption(command, &coordinator_);
    command->footer(
        "Examples:\n"
        "  source <(sheaf completion bash)\n"
        "  sheaf completion zsh > ~/.zfunc/_sheaf\n"
        "  sheaf completion fish > ~/.config/fish/completions/sheaf.fish");
    return command;
  }

  ExitCode Run() override {
    if (wanted_ == Wanted::kJobs) return PrintJobNames();
    const Shell shell = wanted_ == Wanted::kBash  ? Shell::kBash
                        : wanted_ == Wanted::kZsh ? Shell::kZsh
                                                  : Shell::kFish;
    std::fputs(CompletionScript(shell, DescribeProgram(*app_, kJobNamesCommand)).c_str(), stdout);
    return ExitCode::kOk;
  }

 private:
  enum class Wanted { kBash, kZsh, kFish, kJobs };

  ExitCode PrintJobNames() const {
    std::stop_source stop;
    const std::jthread timer([&stop](const std::stop_token& done) {
      SleepUnlessStopped(absl::FromChrono(kJobNamesWait), done);
      stop.request_stop();
    });
    const absl::StatusOr<std::shared_ptr<grpc::Channel>> channel = OpenFarmChannel(coordinator_);
    if (!channel.ok()) return ReportCallError(channel.status());
    FarmClient client(*channel, coordinator_.address, stop.get_token());
    const absl::StatusOr<std::vector<v1::Job>> jobs = client.ListJobs(kJobNamesMax);
    if (!jobs.ok()) return ReportCallError(jobs.status());
    for (const v1::Job& job : *jobs) std::printf("%s\n", job.name().c_str());
    return ExitCode::kOk;
  }

  const CLI::App* app_ = nullptr;
  Wanted wanted_ = Wanted::kBash;
  FarmAddress coordinator_;
};

}  // namespace

std::unique_ptr<Command> MakeCompletionCommand() {
  return std::make_unique<CompletionCommandLine>();
}

}  // namespace sheaf::cli
