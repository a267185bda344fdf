// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf submit: reads scenes on this machine, uploads the blobs that the farm lacks and creates the
// job; with --wait, stays until the job has ended.
#include <cstdio>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "cli/commands/command.h"
#include "cli/commands/effect_costs.h"
#include "cli/commands/options.h"
#include "cli/interruption.h"
#include "cli/job/camera_paths_check.h"
#include "cli/job/farm_channel.h"
#include "cli/job/follow_job.h"
#include "cli/job/identity/opened_files.h"
#include "cli/job/job_json.h"
#include "cli/job/own_command.h"
#include "cli/message.h"
#include "cli/quote/deadline.h"
#include "cli/quote/quote.h"
#include "common/base/status.h"
#include "common/base/surroundings/local_time.h"
#include "common/command_line/command_line.h"
#include "common/rpc/address.h"
#include "coordinator/core/job/job.h"
#include "coordinator/service/grpc/wire.h"
#include "worker/render/ablation/plan_measurement.h"

namespace sheaf::cli {
namespace {

// Longest wait for the quote of a submission.
constexpr absl::Duration kQuoteWaitMax = absl::Seconds(30);
// Follows a job in --after: each frame waits for the one of its number.
constexpr char kByFrame[] = ":frames";

// Whether the quote's pilot found that the scene cannot be rendered.
bool IsBadScene(const absl::Status& status) {
  return absl::IsInvalidArgument(status) &&
         coordinator::IsSceneFailure(std::string(status.message()));
}

class SubmitCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = app->add_subcommand("submit", "Render a scene on a farm");
    AddJobOptions(command, &arguments_);
    AddCoordinatorOption(command, &coordinator_);
    AddJsonFlag(command, &json_);
    command->add_flag("--wait", wait_, "Wait, then download the images");
    command->add_flag("--no-quote", no_quote_, "Do not print a quote first (see sheaf quote)")
        ->envname("SHEAF_NO_QUOTE");
    command->add_option("--title", arguments_.title, "Title of the job (default: the file's name)")
        ->check(IsText(coordinator::kTitleBytesMax));
    command->add_option("--priority", arguments_.priority, "Higher values run first")
        ->check(InRange(-1000, 1000))
        ->capture_default_str();
    AddPlacementOptions(command, &arguments_);
    command
        ->add_option("--after", after_,
                     "Wait until this job is delivered; with JOB:frames, each frame until the "
                     "job's frame of its number is. May be given several times")
        ->check(IsText());
    command->add_option("--approve-after", approve_after_,
                        "Render this many samples per pixel, a power of two; the rest after sheaf "
                        "approve");
    command->add_option("--deadline", deadline_,
                        "Deadline: 18:00 or \"2026-05-04 18:00\". The quote "
                        "says whether the farm makes it; sheaf-autoscaler keeps workers for it");
    command
        ->add_option(
            "--measure", measure_seconds_,
            "First measure for this many seconds, on this machine, the cost and the influence of "
            "each effect of the first frame's scene (see sheaf plan); shown with the job")
        ->check(InRange(render::kMeasureSecondsMin, render::kMeasureSecondsMax));
    command->footer(
        "Examples:\n"
        "  sheaf submit room.pbrt --samples 256 --wait -o room.exr --png room.png\n"
        "  sheaf submit 'shot.####.pbrt' --frames 1-24 -o 'out/shot.####.exr' --wait\n"
        "  job=$(sheaf submit room.pbrt) && sheaf watch \"$job\" -o room.exr\n"
        "  sheaf submit comp.pbrt --frames 1-24 --after jobs/7:frames\n"
        "  sheaf submit room.pbrt --samples 4096 --approve-after 64\n"
        "  sheaf submit room.pbrt --target-error 0.01 --deadline 18:00\n"
        "First it prints a quote from a pilot of a few pixels; --no-quote skips it. Ctrl-C ends\n"
        "the wait, never the job.");
    return command;
  }

  ExitCode Run() override {
    if (absl::Status status = CheckJobArguments(arguments_); !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    if (absl::Status status = ReadDeadline(); !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    if (absl::Status status = ReadDependencies(); !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    const absl::StatusOr<ViewTransform> view = OpenView(arguments_);
    if (!view.ok()) return ReportError(ExitCode::kUsage, view.status());
    const bool is_named =
        !arguments_.output.empty() || !arguments_.png.empty() || !arguments_.denoise_with.empty();
    if (wait_ || is_named) {
      if (absl::Status status = ProbeOutputs(arguments_); !status.ok()) {
        return ReportOutputError(status);
      }
    }
    const Interruption interruption;
    arguments_.keep_camera_paths = measure_seconds_ > 0;
    const absl::StatusOr<PreparedJob> job = PrepareJob(arguments_);
    if (!job.ok()) return ReportSceneError(job.status());
    for (const std::string& text : job->diagnostics) PrintSceneNote(text);
    if (const std::string note = OutsideNote(job->outside); !note.empty()) PrintNote(note);
    if (measure_seconds_ > 0) {
      const TechniqueSet techniques = job->frames.front().settings.techniques;
      absl::Status status = CheckCameraPaths("measurements of effects", techniques);
      if (!status.ok()) return ReportError(ExitCode::kUsage, status);
    }
    const absl::StatusOr<Delivery> delivery =
        wait_ || is_named ? MakeDelivery(arguments_, *job, *view) : Delivery{};
    if (!delivery.ok()) return ReportOutputError(delivery.status());
    const absl::StatusOr<std::shared_ptr<grpc::Channel>> channel = OpenFarmChannel(coordinator_);
    if (!channel.ok()) return ReportCallError(channel.status());
    FarmClient client(*channel, coordinator_.address, interruption.token(), kSubmissionAnswerWait);
    if (absl::Status status = CheckDependencies(&client); !status.ok()) {
      return ReportCallError(status);
    }
    if (absl::Status status = UploadMissing(&client, *job); !status.ok()) {
      return ReportCallError(status);
    }
    v1::CreateJobRequest request = MakeCreateJobRequest(arguments_, *job);
    if (absl::Status status = QuoteAndJudge(&client, *job, &request); !status.ok()) {
      return IsBadScene(status) ? ReportSceneError(status) : ReportCallError(status);
    }
    if (measure_seconds_ > 0) {
      const absl::StatusOr<std::vector<v1::EffectCost>> costs =
          MeasureEffects(arguments_, measure_seconds_);
      if (!costs.ok()) return ReportSceneError(costs.status());
      // They are those of the scene that was submitted.
      if (absl::Status status = CheckUnchanged(job->inputs); !status.ok()) {
        return ReportSceneError(status);
      }
      request.mutable_effect_costs()->Assign(costs->begin(), costs->end());
    }
    AddHolds(&request);
    const absl::StatusOr<v1::Job> created = client.CreateJob(request);
    if (!created.ok()) return ReportCallError(created.status());
    if (absl::Status status = CheckDependencies(&client); !status.ok()) {
      client.CancelJob(RequestFor<v1::CancelJobRequest>(created->name())).IgnoreError();
      return ReportCallError(status);
    }
    if (wait_) return FollowToTheEnd(&client, created->name(), json_, *delivery);
    if (is_named) {
      PrintNote("without --wait no image is written; download it with: " +
                FetchCommand(client, created->name(), *delivery));
    }
    if (!json_) {
      std::printf("%s\n", created->name().c_str());
      return ExitCode::kOk;
    }
    const absl::StatusOr<v1::Job> with_frames =
        client.GetJob(created->name());  // Includes its frames.
    if (!with_frames.ok()) return ReportCallError(with_frames.status());
    std::printf("%s\n", JobJson(*with_frames).c_str());
    return ExitCode::kOk;
  }

 private:
  // Checks that the jobs of --after exist, and are the same as before the upload.
  absl::Status CheckDependencies(FarmClient* client) const {
    for (size_t i = 0; i < after_.size(); ++i) {
      const absl::Status found = client->GetJob(dependencies_[i].job_name()).status();
      if (!found.ok()) return Annotate(found, "--after " + after_[i]);
    }
    return absl::OkStatus();
  }

  // Adds what only a submission has: its command, and what it waits for.
  void AddHolds(v1::CreateJobRequest* request) const {
    const std::string& own = OwnCommand();
    if (own.size() <= coordinator::kCommandBytesMax) request->set_command(own);
    request->set_approve_after_samples(approve_after_);
    request->mutable_dependencies()->Assign(dependencies_.begin(), dependencies_.end());
  }

  absl::Status ReadDependencies() {
    std::set<std::string> names;
    for (const std::string& after : after_) {
      absl::string_view job = after;
      v1::JobDependency& dependency = dependencies_.emplace_back();
      dependency.set_by_frame(absl::ConsumeSuffix(&job, kByFrame));
      dependency.set_job_name(JobName(std::string(job)));
      if (!names.insert(dependency.job_name()).second) {
        return absl::InvalidArgumentError(absl::StrCat(
            "--after ", after, ": ", dependency.job_name(), " is given twice; give it once"));
      }
    }
    return absl::OkStatus();
  }

  absl::Status ReadDeadline() {
    if (deadline_.empty()) return absl::OkStatus();
    const absl::StatusOr<absl::Time> time = ParseDeadline(deadline_, absl::Now(), LocalZone());
    if (time.ok()) deadline_time_ = *time;
    return time.status();
  }

  // Prints the quote, if wanted, and judges the deadline by it. Errors: kCancelled;
  // kInvalidArgument if its pilot finds that the scene cannot be rendered.
  absl::Status QuoteAndJudge(FarmClient* client, const PreparedJob& job,
                             v1::CreateJobRequest* request) {
    const absl::StatusOr<Quote> quote =
        no_quote_ ? absl::StatusOr<Quote>(absl::UnavailableError("not wanted"))
                  : PrintQuote(client, job);
    if (absl::IsCancelled(quote.status()) || IsBadScene(quote.status())) return quote.status();
    if (deadline_.empty()) return absl::OkStatus();
    v1::Deadline& deadline = *request->mutable_deadline();
    deadline.mutable_time()->set_seconds(absl::ToUnixSeconds(deadline_time_));
    const QuoteRow* const row =
        quote.ok() ? RowOfJob(*quote, arguments_.stop.target_error) : nullptr;
    if (row == nullptr) {
      PrintNote(
          "without a quote the deadline cannot be checked yet; sheaf show tells the time left");
      return absl::OkStatus();
    }
    PrintInfo(JudgeDeadline(deadline_time_, absl::Now(), LocalZone(), *row, quote->thread_count));
    if (row->cpu_seconds.value > 0) {
      deadline.mutable_cpu_seconds()->set_value(row->cpu_seconds.value);
      deadline.mutable_cpu_seconds()->set_low(row->cpu_seconds.low);
      deadline.mutable_cpu_seconds()->set_high(row->cpu_seconds.high);
    }
    return absl::OkStatus();
  }

  // Prints the quote on standard error. A farm that cannot answer in time does not prevent the
  // submission.
  absl::StatusOr<Quote> PrintQuote(FarmClient* client, const PreparedJob& job) {
    QuoteArguments asked{.targets = kQuotedErrors, .wait_max = kQuoteWaitMax};
    if (const double target = arguments_.stop.target_error; target > 0) {
      asked.targets = {target};
    }
    const absl::StatusOr<Quote> quote = MakeQuote(client, arguments_, job, asked);
    if (quote.ok()) {
      json_ ? PrintInfo(FormatQuote(*quote))
            : static_cast<void>(std::fputs(FormatQuote(*quote).c_str(), stderr));
    } else if (!absl::IsCancelled(quote.status()) && !IsBadScene(quote.status())) {
      PrintNote(absl::StrCat("no quote: ", quote.status().message()));
    }
    return quote;
  }

  JobArguments arguments_;
  FarmAddress coordinator_;
  bool wait_ = false, json_ = false, no_quote_ = false;
  double measure_seconds_ = 0;
  std::string deadline_;
  absl::Time deadline_time_ = absl::InfiniteFuture();
  std::vector<std::string> after_;
  std::vector<v1::JobDependency> dependencies_;  // Parsed from after_.
  uint64_t approve_after_ = 0;
};

}  // namespace

std::unique_ptr<Command> MakeSubmitCommand() { return std::make_unique<SubmitCommand>(); }

}  // namespace sheaf::cli
