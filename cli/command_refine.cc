// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf refine: go on with a finished job, from what it has.
#include <algorithm>
#include <cstdio>
#include <string>

#include "absl/status/status.h"
#include "cli/farm_command.h"
#include "cli/follow_job.h"
#include "cli/job_json.h"

namespace sheaf::cli {
namespace {

class RefineCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "refine", "Go on with a finished job until its pictures are better");
    AddJob(command);
    AddStopOptions(command, &arguments_.stop);
    command
        ->add_option("--samples", samples_,
                     "Samples per pixel in all; with an error, a time or a budget: at most")
        ->check(CLI::PositiveNumber);
    command->add_flag("--wait", wait_, "Stay until the pictures are here");
    AddPictureOptions(command, &arguments_);
    command->footer(
        "Examples:\n"
        "  sheaf refine jobs/7 --target-error 0.001 --wait -o room.exr\n"
        "  sheaf refine 7 --samples 1024\n"
        "Time and budget count from the job's beginning. What the coordinator no longer keeps of\n"
        "the job (--kept-parts-max) is rendered again.");
    return command;
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    const StopArguments& stop = arguments_.stop;
    if (!stop.IsActive() && samples_ == 0) {
      return ReportError(ExitCode::kUsage,
                         absl::InvalidArgumentError("say how far: --target-error, --time, "
                                                    "--budget or --samples"));
    }
    const absl::StatusOr<ViewTransform> view = OpenView(arguments_);
    if (!view.ok()) return ReportError(ExitCode::kUsage, view.status());
    const absl::StatusOr<v1::Job> job = client->GetJob(job_name());
    if (!job.ok()) return ReportCallError(job.status());
    const absl::StatusOr<std::vector<PicturePaths>> paths = PathsOf(*job, arguments_);
    if (!paths.ok()) return ReportError(ExitCode::kUsage, paths.status());
    v1::RefineJobRequest request;
    request.set_name(job->name());
    request.set_sample_count(samples_);
    if (stop.IsActive()) {
      *request.mutable_stop() = StopRuleOf(stop, std::max(1, job->frames_size()));
      if (samples_ == 0) request.set_sample_count(kStoppedSamplesMax);
    }
    const absl::StatusOr<v1::Job> refined = client->RefineJob(request);
    if (!refined.ok()) return ReportCallError(refined.status());
    if (wait_ || !paths->empty()) {
      return FollowToTheEnd(client, refined->name(), json(), *paths, *view);
    }
    std::printf("%s\n", json() ? JobJson(*refined).c_str() : refined->name().c_str());
    return ExitCode::kOk;
  }

 private:
  JobArguments arguments_;
  uint64_t samples_ = 0;
  bool wait_ = false;
};

}  // namespace

std::unique_ptr<Command> MakeRefineCommand() { return std::make_unique<RefineCommand>(); }

}  // namespace sheaf::cli
