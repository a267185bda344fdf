// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf render: renders with a farm of one machine in this process (local_farm.h).
#include <algorithm>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/commands/command.h"
#include "cli/commands/local_farm.h"
#include "cli/commands/options.h"
#include "cli/interruption.h"
#include "cli/job/follow_job.h"
#include "cli/job/output_files.h"
#include "cli/message.h"
#include "cli/progress_line.h"
#include "common/base/digest.h"
#include "common/base/log.h"
#include "common/base/memory_room.h"
#include "common/base/text/shell_quoted.h"
#include "common/command_line/command_line.h"

namespace sheaf::cli {
namespace {

class RenderCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = app->add_subcommand("render", "Render a scene in this process");
    AddJobOptions(command, &arguments_);
    AddJsonFlag(command, &json_);
    command->add_option("--threads", farm_.worker.thread_count, "Threads; 0: all processors")
        ->check(InRange(0, 4096))
        ->capture_default_str();
    command->add_option("--http", farm_.http_address,
                        "Serve the page that shows the progress of the image, HOST:PORT");
    command->add_option("--keep-state", farm_.kept_state,
                        "Keep finished work in this folder; the same command continues from there");
    command
        ->add_option("--scene-memory-max", farm_.worker.scene_memory_bytes_max,
                     "Limit of memory for scenes, e.g. 4G (default 4G)")
        ->transform(AsBytes());
    command
        ->add_option("--texture-memory-max", farm_.worker.texture_memory_bytes_max,
                     "Limit of memory for texture tiles, e.g. 512M (default 512M)")
        ->transform(AsBytes());
    command
        ->add_option("--volume-memory-max", farm_.worker.volume_memory_bytes_max,
                     "Limit of memory for volumes that sheaf pack made, e.g. 2G (default 512M)")
        ->transform(AsBytes());
    command->footer(
        "Examples:\n"
        "  sheaf render room.pbrt -o room.exr --png room.png\n"
        "  sheaf render room.pbrt --samples 16 --crop 200,80,456,272 -o detail.png\n"
        "  sheaf render room.pbrt --samples 4096 --keep-state room.state -o room.exr\n"
        "Ctrl-C keeps the rendered parts in a folder for --keep-state and prints its name.");
    return command;
  }

  ExitCode Run() override {
    if (absl::Status status = CheckJobArguments(arguments_); !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    const absl::StatusOr<ViewTransform> view = OpenView(arguments_);
    if (!view.ok()) return ReportError(ExitCode::kUsage, view.status());
    if (absl::Status status = ProbeOutputs(arguments_); !status.ok()) {
      return ReportOutputError(status);
    }
    const Interruption interruption;
    SetLogName("sheaf render");
    SetLogLevel(LogLevel::kWarning);  // The progress line shows the rest.
    absl::StatusOr<PreparedJob> job = PrepareJob(arguments_, /*keeps_description=*/true);
    if (!job.ok()) return ReportSceneError(job.status());
    for (const std::string& text : job->diagnostics) PrintSceneNote(text);

    const absl::StatusOr<Delivery> delivery = MakeDelivery(arguments_, *job, *view);
    if (!delivery.ok()) return ReportOutputError(delivery.status());
    scenes_ = ScenesOf(&*job);
    farm_.worker.scenes = scenes_;
    const absl::StatusOr<std::unique_ptr<LocalFarm>> farm = LocalFarm::Open(farm_);
    if (!farm.ok()) return ReportError(ExitCode::kFile, farm.status());
    if (!farm_.http_address.empty()) {
      PrintInfo("watch at " + (*farm)->http_url());
    }
    return RenderOn(farm->get(), *job, *delivery, interruption);
  }

 private:
  ExitCode RenderOn(LocalFarm* farm, const PreparedJob& job, const Delivery& delivery,
                    const Interruption& interruption) {
    FarmClient client(farm->channel(), "this process", interruption.token());
    if (absl::Status status = UploadMissing(&client, job, farm->blobs()); !status.ok()) {
      return ReportCallError(status);
    }
    const absl::StatusOr<v1::Job> created =
        CreateOrContinue(&client, MakeCreateJobRequest(arguments_, job));
    if (!created.ok()) return ReportCallError(created.status());

    if (absl::Status status = farm->StartWorker(); !status.ok()) {
      return ReportError(ExitCode::kFile, status);
    }
    ImageSaver images(&client, delivery);
    const absl::StatusOr<v1::Job> ended = FollowJob(&client, created->name(), json_, &images);
    if (absl::IsCancelled(ended.status())) {
      return ReportInterruption(farm, client.Uninterrupted()->GetJob(created->name()));
    }
    if (!ended.ok()) return ReportCallError(ended.status());
    if (const absl::Status saved = images.status(); !saved.ok()) {
      PrintInfo(KeepState(farm));
      const ExitCode code = absl::IsCancelled(saved) ? ExitCode::kInterrupted : ExitCode::kFile;
      ReportError(code, saved);
      if (ended->state() == v1::Job::STATE_SUCCEEDED) return code;
    }
    if (!json_) PrintPages();
    return ReportEnd(*ended, /*images_written=*/true, RemedyText(farm, *ended), arguments_.detail);
  }

  // Says what the pages of large volumes cost.
  void PrintPages() const {
    const volume::PageCounts counts = scenes_->page_totals().counts();
    if (counts.pages_pinned == 0) return;
    PrintInfo(absl::StrFormat(
        "volumes: %.1f %% of %d lookups of pages were in memory; %d pages (%s) read, %d evicted; "
        "at most %s in memory",
        100 -
            100 * static_cast<double>(counts.pages_read) / static_cast<double>(counts.pages_pinned),
        counts.pages_pinned, counts.pages_read, FormatMemory(counts.bytes_read),
        counts.pages_evicted, FormatMemory(scenes_->page_totals().most_bytes())));
  }

  // The command that renders the missing images of a failed or cancelled job. Finished work on them
  // is kept.
  std::string RemedyText(LocalFarm* farm, const v1::Job& job) const {
    const std::string missing = MissingImages(job);
    if (missing.empty()) return "";
    const bool has_parts = std::ranges::any_of(job.frames(), [](const v1::Frame& frame) {
      return !frame.complete() && frame.progress().sample_count_done() > 0;
    });
    if (has_parts || !farm_.kept_state.empty()) return KeepState(farm);
    if (job.frames_size() == 1) return "";
    return absl::StrCat("the same command with --frames ", missing, " renders ",
                        missing.find_first_of(",-") == std::string::npos ? "it" : "them");
  }

  // Keeps the farm's state and returns the text that says how to resume from it.
  std::string KeepState(LocalFarm* farm) const {
    const std::string& folder = farm->KeepState();
    if (!farm_.kept_state.empty()) return "the same command continues from here";
    return absl::StrCat("rendered parts are kept in ", folder,
                        "; the same command with --keep-state ", ShellQuoted(folder),
                        " continues from here");
  }

  // Merged samples are kept.
  ExitCode ReportInterruption(LocalFarm* farm, const absl::StatusOr<v1::Job>& job) const {
    const double fraction = job.ok() ? FractionDone(job->progress()) : 0;
    const bool keeps = fraction > 0 || !farm_.kept_state.empty();
    return ReportError(ExitCode::kInterrupted,
                       absl::CancelledError(
                           absl::StrFormat("interrupted at %.1f %%; %s", 100 * fraction,
                                           keeps ? KeepState(farm) : "nothing was rendered yet")));
  }

  // The same command continues the job of its last run: it retries failed work, or creates a new
  // job if that one was cancelled.
  static absl::StatusOr<v1::Job> CreateOrContinue(FarmClient* client,
                                                  v1::CreateJobRequest request) {
    request.clear_request_id();
    const std::string content = request.SerializeAsString();
    absl::StatusOr<v1::Job> job;
    int cancelled_count = 0;
    do {
      request.set_request_id(RepeatableRequestId(content, cancelled_count++));
      job = client->CreateJob(request);
    } while (job.ok() && job->state() == v1::Job::STATE_CANCELLED);
    if (!job.ok() || job->state() != v1::Job::STATE_FAILED) return job;
    PrintInfo("the work that failed is tried again; it failed because: " + job->failure());
    v1::RetryTasksRequest retry;
    retry.set_name(job->name());
    return client->RetryTasks(retry);
  }

  static std::string RepeatableRequestId(const std::string& content, int cancelled_count) {
    const std::string hex =
        Sha256Hex(cancelled_count == 0 ? content : absl::StrCat(content, cancelled_count));
    return absl::StrCat(hex.substr(0, 8), "-", hex.substr(8, 4), "-4", hex.substr(13, 3), "-8",
                        hex.substr(17, 3), "-", hex.substr(20, 12));
  }

  JobArguments arguments_;
  LocalFarmOptions farm_;
  std::shared_ptr<worker::DirectScenes> scenes_;  // Set before anything is rendered.
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> MakeRenderCommand() { return std::make_unique<RenderCommand>(); }

}  // namespace sheaf::cli
