// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf study: measures the cost of accuracy for a scene and for which settings, as a page and as
// JSON.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "cli/commands/command.h"
#include "cli/commands/options.h"
#include "cli/interruption.h"
#include "cli/job/farm_channel.h"
#include "cli/job/opened_scene.h"
#include "cli/job/output_files.h"
#include "cli/message.h"
#include "cli/quote/farm_size.h"
#include "cli/study/study.h"
#include "cli/study/study_page.h"
#include "common/base/file.h"
#include "common/film/denoised_output.h"
#include "common/scene/settings/path_shares.h"

namespace sheaf::cli {
namespace {

class StudyCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = app->add_subcommand(
        "study", "Measure the cost of accuracy: settings, effects and kinds of paths of a scene");
    AddSettingsOptions(command, &arguments_);
    AddJsonFlag(command, &json_);
    command->add_option("-o,--output", page_path_, "The page to write, a single file (.html)");
    command->add_option("--json-output", json_path_, "Also write the figures as JSON (.json)");
    command
        ->add_option("--minutes", options_.minutes,
                     "Approximate duration; more minutes give less noise")
        ->check(InRange(kStudyMinutesMin, kStudyMinutesMax))
        ->capture_default_str();
    command->add_option("--threads", options_.threads, "Threads that render (default: all)")
        ->check(InRange(1, 4096));
    AddCoordinatorOption(command, &coordinator_);
    coordinator_option_ = command->get_option("--coordinator");
    coordinator_option_->description(
        absl::StrCat(coordinator_option_->get_description(),
                     "; if named, prices are given for its workers too, which render nothing"));
    command->footer(
        "Examples:\n"
        "  sheaf study room.pbrt -o room.html\n"
        "  sheaf study room.pbrt --coordinator farm.example.org -o room.html\n"
        "  sheaf study room.pbrt --minutes 60 --json-output room.json\n"
        "Tiles spread over the frame are rendered with each setting in turn and compared with one\n"
        "reference that the study renders. Crops show the image at four prices. Everything is\n"
        "rendered on this machine; the times of a farm assume equally fast threads, and "
        "sheaf\nquote measures its own. Nothing is denoised. Light paths (--techniques) reach "
        "every pixel:\ntheir errors and costs are measured on a small image of the whole frame, "
        "and compared\nwith those of paths from the camera alone.");
    return command;
  }

  ExitCode Run() override {
    const RenderSettings& asked = arguments_.settings;
    if (HasDenoised(asked.outputs)) {
      return ReportError(ExitCode::kUsage,
                         absl::InvalidArgumentError(
                             "a study measures the cost of samples, and denoises nothing: remove "
                             "--denoise; sheaf quote --denoise gives the cost of an error after "
                             "it"));
    }
    if (asked.samples || !asked.outputs.empty() || asked.light_groups || asked.light_paths) {
      return ReportError(
          ExitCode::kUsage,
          absl::InvalidArgumentError(
              "a study writes no image and chooses its number of samples: remove --samples, --aov, "
              "--cryptomatte, --light-groups and --light-paths, and give --minutes instead"));
    }
    if (absl::Status status = CheckNames(); !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    if (absl::Status status = CheckOutputs({json_path_, page_path_}, {arguments_.scene});
        !status.ok()) {
      return ReportOutputError(status);
    }
    const Interruption interruption;
    OpenedScene opened;
    if (const ExitCode code = OpenScene(arguments_, &opened); code != ExitCode::kOk) return code;
    if (HasOneTile(opened.settings)) {
      return ReportError(ExitCode::kUsage,
                         absl::InvalidArgumentError(
                             opened.settings.IsStereo()
                                 ? "a study compares spread tiles, and eyes that share paths are "
                                   "rendered whole: remove --stereo, and study one eye"
                                 : "a study compares spread tiles of paths of one pixel: remove "
                                   "+sharing or +mutations of --techniques"));
    }
    std::vector<std::string> inputs;
    for (const auto& [name, path] : opened.file.files->FilesUsed()) inputs.push_back(path);
    if (absl::Status status = CheckOutputs({json_path_, page_path_}, inputs); !status.ok()) {
      return ReportOutputError(status);
    }
    const SceneDescription& scene = opened.file.read.scene;
    const absl::StatusOr<std::string> techniques = ChooseTechniques(
        asked.measure_techniques ? std::optional(render::TechniqueEffort::kAsked) : std::nullopt,
        /*may_share=*/false, scene, *opened.file.files, &opened.settings);
    if (!techniques.ok()) return ReportSceneError(techniques.status());
    if (!techniques->empty()) PrintInfo(*techniques);
    if (options_.threads == 0) {
      options_.threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    }
    if (const ExitCode code = DescribeFarm(); code != ExitCode::kOk) return code;
    options_.on_progress = [](const std::string& line) { PrintInfo(line); };
    absl::StatusOr<StudyResult> result =
        RunStudy(scene, opened.settings, *opened.file.files, options_);
    if (!result.ok()) return ReportSceneError(result.status());
    result->scene = arguments_.scene;
    return Deliver(*result);
  }

 private:
  absl::Status CheckNames() const {
    const absl::Status status = CheckOutputName("-o", page_path_, {".html", ".htm"});
    return status.ok() ? CheckOutputName("--json-output", json_path_, {".json"}) : status;
  }

  // Counts the workers of the named coordinator. Nothing else is asked of the farm, so that an
  // address that does not answer costs no study.
  ExitCode DescribeFarm() {
    if (coordinator_option_->count() == 0) return ExitCode::kOk;
    const absl::StatusOr<std::shared_ptr<grpc::Channel>> channel = OpenFarmChannel(coordinator_);
    if (!channel.ok()) return ReportCallError(channel.status());
    FarmClient client(*channel, coordinator_.address, std::stop_token());
    const absl::StatusOr<FarmSize> size = SizeOfFarm(&client);
    if (!size.ok()) return ReportCallError(size.status());
    options_.farm = StudyFarm{coordinator_.address, size->worker_count, size->thread_count,
                              size->other_job_count};
    return ExitCode::kOk;
  }

  ExitCode Deliver(const StudyResult& result) const {
    const std::string json = StudyJson(result);
    for (const auto& [path, bytes] :
         {std::pair(json_path_, json), std::pair(page_path_, StudyPage(json))}) {
      if (path.empty()) continue;
      const absl::Status status = WriteOrKeep(
          path, [&bytes = bytes](const std::string& p) { return WriteFileAtomically(p, bytes); });
      if (!status.ok()) return ReportError(ExitCode::kFile, status);
    }
    if (json_) {
      std::printf("%s\n", json.c_str());
      return ExitCode::kOk;
    }
    for (const std::string& line : result.recommendation) std::printf("%s\n", line.c_str());
    return ExitCode::kOk;
  }

  JobArguments arguments_;
  StudyOptions options_{.minutes = 10, .threads = 0, .farm = {}, .on_progress = {}};
  FarmAddress coordinator_;
  CLI::Option* coordinator_option_ = nullptr;
  std::string page_path_, json_path_;
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> MakeStudyCommand() { return std::make_unique<StudyCommand>(); }

}  // namespace sheaf::cli
