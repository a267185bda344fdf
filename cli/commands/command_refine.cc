// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf refine: continues a finished job from its present samples.
#include <algorithm>
#include <cstdio>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "cli/commands/farm_command.h"
#include "cli/commands/stop_options.h"
#include "cli/job/follow_job.h"
#include "cli/job/job_json.h"
#include "cli/progress_line.h"

namespace sheaf::cli {
namespace {

// Target errors, as fractions of the present error, that are priced when none is requested.
constexpr double kPricedFractions[] = {0.5, 0.25, 0.1, 0.05, 0.01};

std::string BandText(const v1::Estimate& seconds) {
  if (seconds.value() == 0) return "-";
  return absl::StrCat(FormatTime(seconds.value()), " (", FormatTime(seconds.low()), " to ",
                      FormatTime(seconds.high()), ")");
}

class RefineCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "refine", "Continue a finished job to improve its images");
    AddJob(command);
    AddStopOptions(command, &arguments_.stop);
    command
        ->add_option("--samples", samples_,
                     "Total samples per pixel; with an error, a time or a budget: the maximum")
        ->check(InRange(int64_t{1}));
    command->add_flag("--wait", wait_, "Wait, then download the images");
    command->add_flag(
        "--price", price_,
        "Only print the cost: for --target-error, or for several errors if it is not given");
    AddImageOptions(command, &arguments_);
    command->footer(
        "Examples:\n"
        "  sheaf refine jobs/7 --target-error 0.001 --wait -o room.exr\n"
        "  sheaf refine 7 --samples 1024\n"
        "  sheaf refine 7 --price\n"
        "Time and budget count from the start of the job. Where the coordinator has removed the\n"
        "parts of the job (sheaf show says so), it continues from the image; single parts that it\n"
        "no longer keeps (--kept-parts-max) are rendered again.");
    return command;
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    const StopArguments& stop = arguments_.stop;
    if (price_) return PrintPrices(client);
    if (!stop.IsActive() && samples_ == 0) {
      return ReportError(
          ExitCode::kUsage,
          absl::InvalidArgumentError(
              "a refinement needs a limit; give --target-error, --time, --budget or --samples"));
    }
    if (absl::Status status = CheckImageNames(arguments_); !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    const absl::StatusOr<ViewTransform> view = OpenView(arguments_);
    if (!view.ok()) return ReportError(ExitCode::kUsage, view.status());
    const absl::StatusOr<v1::Job> job = client->GetJob(job_name());
    if (!job.ok()) return ReportCallError(job.status());
    const absl::StatusOr<Delivery> delivery = MakeDelivery(arguments_, *job, *view);
    if (!delivery.ok()) return ReportOutputError(delivery.status());
    v1::RefineJobRequest request;
    request.set_name(job->name());
    request.set_sample_count(samples_);
    if (stop.IsActive()) {
      *request.mutable_stop() = StopRuleOf(stop, std::max(1, job->frames_size()));
      if (samples_ == 0) request.set_sample_count(kStoppedSamplesMax);
    }
    absl::StatusOr<v1::Job> refined = client->RefineJob(request);
    if (refined.ok() && json()) refined = client->GetJob(refined->name());  // Includes its frames.
    if (!refined.ok()) return ReportCallError(refined.status());
    if (wait_ || !delivery->paths.empty()) {
      return FollowToTheEnd(client, refined->name(), json(), *delivery);
    }
    std::printf("%s\n", json() ? JobJson(*refined).c_str() : refined->name().c_str());
    return ExitCode::kOk;
  }

 private:
  ExitCode PrintPrices(FarmClient* client) {
    const absl::StatusOr<v1::Job> job = client->GetJob(job_name());
    if (!job.ok()) return ReportCallError(job.status());
    v1::PriceRefinementRequest request;
    request.set_name(job->name());
    if (arguments_.stop.target_error > 0) {
      request.add_target_errors(arguments_.stop.target_error);
    } else if (job->state() == v1::Job::STATE_SUCCEEDED && job->progress().relative_mse() == 0) {
      return ReportError(ExitCode::kUsage,
                         absl::FailedPreconditionError(
                             absl::StrCat(job->name(),
                                          ": the error of its images is unknown, so no targets can "
                                          "be derived from it; give --target-error")));
    } else {
      for (const double reference_fraction : kPricedFractions) {
        request.add_target_errors(reference_fraction * job->progress().relative_mse());
      }
    }
    const absl::StatusOr<v1::PriceRefinementResponse> prices = client->PriceRefinement(request);
    if (!prices.ok()) return ReportCallError(prices.status());
    if (json()) {
      std::printf("%s\n", RefinementPricesJson(*prices).c_str());
      return ExitCode::kOk;
    }
    std::printf("%-14s %10s  %-34s %s\n", "error (relMSE)", "samples",
                "additional CPU time (80 % band)", "wall time (80 % band)");
    for (const v1::RefinementPrice& price : prices->prices()) {
      std::printf("%-14.3g %10.1f  %-34s %s%s\n", price.target_error(),
                  price.samples_per_pixel().value(), BandText(price.cpu_seconds()).c_str(),
                  BandText(price.wall_seconds()).c_str(),
                  price.reached() ? "" : "  not reached within the maximum of samples per pixel");
    }
    std::printf("now %.3g; wall time for %d threads", job->progress().relative_mse(),
                prices->thread_count());
    if (prices->jobs_before_count() > 0) {
      std::printf(", including the time of %d other %s", prices->jobs_before_count(),
                  prices->jobs_before_count() == 1 ? "job" : "jobs");
    }
    std::printf("\n");
    return ExitCode::kOk;
  }

  JobArguments arguments_;
  uint64_t samples_ = 0;
  bool wait_ = false, price_ = false;
};

}  // namespace

std::unique_ptr<Command> MakeRefineCommand() { return std::make_unique<RefineCommand>(); }

}  // namespace sheaf::cli
