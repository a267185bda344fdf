// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf quote: forecasts the cost of a scene for several target errors before it is rendered.
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "cli/commands/command.h"
#include "cli/commands/error_option.h"
#include "cli/commands/local_farm.h"
#include "cli/commands/options.h"
#include "cli/interruption.h"
#include "cli/job/farm_channel.h"
#include "cli/job/follow_job.h"
#include "cli/job/identity/opened_files.h"
#include "cli/message.h"
#include "cli/quote/quote.h"
#include "common/base/log.h"
#include "common/rpc/address.h"

namespace sheaf::cli {
namespace {

class QuoteCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        app->add_subcommand("quote", "Estimate the cost of a scene for several errors");
    AddSettingsOptions(command, &arguments_);
    AddFramesOption(command, &arguments_);
    AddResumeOption(command, &arguments_);
    AddPartitionOptions(command, &arguments_);
    command
        ->add_option("--targets", asked_.targets,
                     "Errors to quote, as for --target-error: 20%,10%, or relMSE, 0.04,0.01")
        ->delimiter(',')
        ->transform(PercentAsRelativeMse())
        ->check(InRange(1e-9, 1e3))
        ->capture_default_str();
    command
        ->add_option("--minutes", asked_.minutes,
                     "Wall times in minutes to quote the least error for, 10,60,...")
        ->delimiter(',')
        ->check(InRange(0.01, 1e6))
        ->capture_default_str();
    command
        ->add_option("--priority", arguments_.priority,
                     "Priority of the quoted job: higher values run first and wait for fewer jobs")
        ->check(InRange(-1000, 1000))
        ->capture_default_str();
    AddCoordinatorOption(command, &coordinator_);
    command->add_flag("--local", here_,
                      "Quote for this machine only, as sheaf render would use it");
    command
        ->add_option("--threads", farm_.worker.thread_count,
                     "With --local: threads; 0: all processors")
        ->check(InRange(0, 4096));
    AddJsonFlag(command, &json_);
    command->footer(
        "Examples:\n"
        "  sheaf quote room.pbrt\n"
        "  sheaf quote room.pbrt --local --targets 15%,10%\n"
        "  sheaf quote room.pbrt --minutes 10,60\n"
        "  sheaf quote 'shot.####.pbrt' --frames 1-240 --json\n"
        "  sheaf quote room.pbrt --resume-from room.exr --targets 7%\n"
        "An error is the typical error of a pixel, the root of relMSE, before denoising. With\n"
        "--denoise, further rows say what it costs in the denoised layer.\n"
        "A pilot renders a few of the pixels, at no more than 3 % of the price of the loosest\n"
        "error, before all other jobs. Bands are 80 % prediction intervals. Wall times include\n"
        "the time that the farm's other jobs take first. With --resume-from the price covers\n"
        "only the missing samples. Prices include the light passes and the training of the\n"
        "frame's --techniques; the pilot of a guided frame pays for a training in addition.");
    return command;
  }

  ExitCode Run() override {
    if (absl::Status status = CheckJobArguments(arguments_); !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    const Interruption interruption;
    const absl::StatusOr<PreparedJob> job = PrepareJob(arguments_);
    if (!job.ok()) return ReportSceneError(job.status());
    for (const std::string& text : job->diagnostics) PrintSceneNote(text);
    if (!here_) {
      if (const std::string note = OutsideNote(job->outside); !note.empty()) PrintNote(note);
      const absl::StatusOr<std::shared_ptr<grpc::Channel>> channel = OpenFarmChannel(coordinator_);
      if (!channel.ok()) return ReportCallError(channel.status());
      FarmClient client(*channel, coordinator_.address, interruption.token());
      return QuoteOn(&client, *job, nullptr);
    }
    SetLogName("sheaf quote");
    SetLogLevel(LogLevel::kWarning);
    const absl::StatusOr<std::unique_ptr<LocalFarm>> farm = LocalFarm::Open(farm_);
    if (!farm.ok()) return ReportError(ExitCode::kFile, farm.status());
    if (absl::Status status = (*farm)->StartWorker(); !status.ok()) {
      return ReportError(ExitCode::kFile, status);
    }
    FarmClient client((*farm)->channel(), "this process", interruption.token());
    return QuoteOn(&client, *job, (*farm)->blobs());
  }

 private:
  // own: as for UploadMissing.
  ExitCode QuoteOn(FarmClient* client, const PreparedJob& job, const BlobStore* own) {
    if (absl::Status status = UploadMissing(client, job, own); !status.ok()) {
      return ReportCallError(status);
    }
    const absl::StatusOr<Quote> quote = MakeQuote(client, arguments_, job, asked_);
    if (!quote.ok()) return ReportCallError(quote.status());
    std::fputs(json_ ? (QuoteJson(*quote) + "\n").c_str() : FormatQuote(*quote).c_str(), stdout);
    return ExitCode::kOk;
  }

  JobArguments arguments_;
  QuoteArguments asked_{.targets = kQuotedErrors, .minutes = kQuotedMinutes};
  LocalFarmOptions farm_;
  FarmAddress coordinator_;
  bool here_ = false, json_ = false;
};

}  // namespace

std::unique_ptr<Command> MakeQuoteCommand() { return std::make_unique<QuoteCommand>(); }

}  // namespace sheaf::cli
