// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf repro: renders the task of a bundle on this machine, in the process that a worker would
// start for it.
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "cli/bundle/bundle_file.h"
#include "cli/bundle/reproduction.h"
#include "cli/commands/command.h"
#include "cli/commands/options.h"
#include "cli/interruption.h"
#include "cli/message.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/base/status.h"
#include "common/command_line/command_line.h"
#include "worker/sandbox/direct_scenes.h"
#include "worker/sandbox/sandboxed_scenes.h"
#include "worker/sandbox/scene_server.h"
#include "worker/service/embedded_worker.h"

namespace sheaf::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kSecondsMax = 1e6;
// The room that the cache needs in addition to the files of a scene.
constexpr uint64_t kCacheSpareBytes = uint64_t{1} << 20;

// A folder for the scene's files, which is removed at the end.
class ReproFolder {
 public:
  static absl::StatusOr<std::unique_ptr<ReproFolder>> Make() {
    const char* parent = std::getenv("TMPDIR");
    std::string path = absl::StrCat(parent == nullptr || parent[0] == '\0' ? "/tmp" : parent,
                                    "/sheaf-repro-XXXXXX");
    if (::mkdtemp(path.data()) == nullptr) {
      return StatusFromErrno(errno,
                             absl::StrCat("creating a folder ", path, " (TMPDIR sets another)"));
    }
    return std::unique_ptr<ReproFolder>(new ReproFolder(path));
  }
  ~ReproFolder() {
    std::error_code ignored;  // Files left in a temporary folder are harmless.
    std::filesystem::remove_all(path_, ignored);
  }
  ReproFolder(const ReproFolder&) = delete;
  ReproFolder& operator=(const ReproFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  explicit ReproFolder(std::string path) : path_(std::move(path)) {}
  const std::string path_;
};

std::string TextOf(const v1::RecordedFailure& failure) {
  return absl::StrCat(failure.kind(),
                      failure.worker().empty() ? "" : absl::StrCat(" on ", failure.worker()), ": ",
                      failure.message());
}

class ReproCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    const worker::WorkerOptions defaults;
    limits_.scene_memory_bytes_max = defaults.scene_memory_bytes_max;
    limits_.texture_memory_bytes_max = defaults.texture_memory_bytes_max;
    limits_.volume_memory_bytes_max = defaults.volume_memory_bytes_max;
    CLI::App* command = app->add_subcommand("repro", "Reproduce the failure of a bundle");
    command->add_option("BUNDLE", path_, "The file that sheaf bundle wrote")->required();
    AddJsonFlag(command, &json_);
    command->add_option("-o,--output", output_,
                        "If the task renders, write its part: an EXR of the sums of its samples\n"
                        "(of a training: the guiding field)");
    command->add_flag("--no-sandbox", no_sandbox_,
                      "Render in this process, as for a debugger; only scenes that you trust");
    command
        ->add_option("--memory-limit", limits_.scene_memory_bytes_max,
                     "Limit of memory for the scene, as sheaf-worker --scene-memory-max\n"
                     "(default 4G)")
        ->transform(AsBytes());
    command
        ->add_option("--texture-memory-max", limits_.texture_memory_bytes_max,
                     "Limit of memory for texture tiles (default 512M)")
        ->transform(AsBytes());
    command
        ->add_option("--volume-memory-max", limits_.volume_memory_bytes_max,
                     "Limit of memory for volumes that sheaf pack made (default 512M)")
        ->transform(AsBytes());
    command
        ->add_option("--load-seconds-max", load_seconds_max_,
                     "Time to load the scene, after which its process is killed (default: 120,\n"
                     "and 1 for each megabyte of the scene's files)")
        ->check(InRange(1.0, kSecondsMax));
    command
        ->add_option("--task-seconds-max", task_seconds_max_,
                     "Time to render the task, after which its process is killed")
        ->check(InRange(1.0, kSecondsMax))
        ->capture_default_str();
    command->footer(
        "Examples:\n"
        "  sheaf repro bundle-7-12-3.tar\n"
        "  sheaf repro crash.tar --memory-limit 2G -o part.exr\n"
        "  gdb --args sheaf repro crash.tar --no-sandbox\n"
        "Exit codes: 0 the task renders; 1 it fails as recorded; 7 it fails in another way;\n"
        "6 the bundle cannot be read. Limits are those of a worker by default: give those of the\n"
        "worker that failed.");
    return command;
  }

  ExitCode Run() override {
    SetLogLevel(LogLevel::kWarning);
    if (!output_.empty()) {
      if (absl::Status status = CheckWritable(output_); !status.ok()) {
        return ReportError(ExitCode::kFile, status);
      }
    }
    uint64_t size_bytes = 0;
    absl::StatusOr<ReadBytesAt> read = OpenForReading(path_, &size_bytes);
    if (!read.ok()) return ReportError(ExitCode::kFile, read.status());
    const absl::StatusOr<Bundle> bundle = Bundle::Open(*std::move(read), size_bytes);
    if (!bundle.ok()) return ReportError(ExitCode::kFile, Annotate(bundle.status(), path_));
    if (bundle->task().numeric_profile() != NumericProfile()) {
      PrintNote(absl::StrCat("this program has another numeric profile than the job (",
                             Printable(bundle->task().numeric_profile()),
                             "): it may end otherwise, and bits may differ"));
    }
    return Render(*bundle, size_bytes);
  }

 private:
  absl::StatusOr<std::unique_ptr<worker::SceneOpener>> MakeScenes() const {
    if (no_sandbox_) return std::make_unique<worker::DirectScenes>();
    worker::SandboxOptions options;
    options.mode = worker::SandboxMode::kBest;
    options.program.arguments = {"sheaf", worker::kSceneProcessFlag};
    if (load_seconds_max_.has_value()) options.load_time_max = absl::Seconds(*load_seconds_max_);
    options.task_time_max = absl::Seconds(task_seconds_max_);
    return worker::SandboxedScenes::Make(options);
  }

  ExitCode Render(const Bundle& bundle, uint64_t size_bytes) {
    const Interruption interruption;
    const absl::StatusOr<std::unique_ptr<ReproFolder>> folder = ReproFolder::Make();
    if (!folder.ok()) return ReportError(ExitCode::kFile, folder.status());
    const absl::StatusOr<std::unique_ptr<ContentCache>> cache =
        ContentCache::Open((*folder)->path(), {size_bytes + kCacheSpareBytes});
    if (!cache.ok()) return ReportError(ExitCode::kFile, cache.status());
    const absl::StatusOr<std::unique_ptr<worker::SceneOpener>> scenes = MakeScenes();
    if (!scenes.ok()) return ReportError(ExitCode::kFile, scenes.status());
    limits_.build_threads = limits_.render_threads =
        static_cast<uint32_t>(worker::AvailableThreadCount());
    const absl::StatusOr<Reproduction> result =
        Reproduce(bundle, cache->get(), scenes->get(), limits_, interruption.token());
    if (!result.ok()) return ReportCallError(result.status());
    if (result->ending == Ending::kRendered && !output_.empty()) {
      const absl::Status written = WriteFileAtomically(output_, result->part.exr_bytes);
      if (!written.ok()) return ReportError(ExitCode::kFile, written);
    }
    if (json_) {
      PrintJson(bundle.task(), *result);
    } else {
      PrintText(bundle.task(), *result);
    }
    switch (result->ending) {
      case Ending::kRendered:
        return ExitCode::kOk;
      case Ending::kFailedAsRecorded:
        return ExitCode::kFailed;
      case Ending::kFailedOtherwise:
        break;
    }
    return ExitCode::kOtherwise;
  }

  void PrintText(const v1::TaskBundle& task, const Reproduction& result) const {
    const std::string name = absl::StrCat(Printable(task.frame_name()), ", task ", task.task());
    if (result.ending == Ending::kRendered) {
      std::printf("%s: rendered in %.1f s of CPU time, %zu bytes\nsha256     %s\n", name.c_str(),
                  result.part.cpu_seconds, result.part.exr_bytes.size(),
                  result.part_sha256.c_str());
    } else {
      std::printf("%s: %s: %s\nmessage    %s\n", name.c_str(), EndingName(result.ending),
                  coordinator::FailureKindName(result.kind),
                  PrintableLines(result.message).c_str());
    }
    if (result.same_message) {
      std::printf("recorded   the same message\n");
      return;
    }
    for (const v1::RecordedFailure& failure : task.failures()) {
      std::printf("recorded   %s\n", Printable(TextOf(failure)).c_str());
    }
    if (task.failures().empty()) std::printf("recorded   no failure\n");
  }

  void PrintJson(const v1::TaskBundle& task, const Reproduction& result) const {
    const bool rendered = result.ending == Ending::kRendered;
    Json recorded = Json::array();
    for (const v1::RecordedFailure& failure : task.failures()) {
      recorded.push_back({{"kind", failure.kind()},
                          {"worker", failure.worker()},
                          {"count", failure.count()},
                          {"message", failure.message()}});
    }
    const Json object = {
        {"frame", task.frame_name()},
        {"task", task.task()},
        {"ending", EndingName(result.ending)},
        {"kind", rendered ? Json() : Json(coordinator::FailureKindName(result.kind))},
        {"message", result.message},
        {"same_message", result.same_message},
        {"recorded", recorded},
        {"part_sha256", rendered ? Json(result.part_sha256) : Json()},
        {"part_bytes", result.part.exr_bytes.size()},
        {"cpu_seconds", result.part.cpu_seconds}};
    std::printf("%s\n", object.dump(-1, ' ', false, Json::error_handler_t::replace).c_str());
  }

  std::string path_, output_;
  worker::SceneLimits limits_;
  std::optional<double> load_seconds_max_;
  double task_seconds_max_ = 3600;
  bool no_sandbox_ = false, json_ = false;
};

}  // namespace

std::unique_ptr<Command> MakeReproCommand() { return std::make_unique<ReproCommand>(); }

}  // namespace sheaf::cli
