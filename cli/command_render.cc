// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf render: a farm of one. Coordinator and worker live in this process and talk over a channel
// that never leaves it; the code is that of the large farm.
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "cli/command.h"
#include "cli/follow_job.h"
#include "cli/interruption.h"
#include "cli/options.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "coordinator/service/coordinator_server.h"
#include "worker/service/embedded_worker.h"

namespace sheaf::cli {
namespace {

// The folder of one run's state; removed at the end unless it has a name of its own.
class StateDirectory {
 public:
  static absl::StatusOr<std::unique_ptr<StateDirectory>> Open(const std::string& kept) {
    if (!kept.empty()) {
      if (absl::Status status = MakeDirectories(kept); !status.ok()) return status;
      return std::unique_ptr<StateDirectory>(new StateDirectory(kept, true));
    }
    const char* parent = std::getenv("TMPDIR");
    std::string path = absl::StrCat(parent == nullptr || parent[0] == '\0' ? "/tmp" : parent,
                                    "/sheaf-render-XXXXXX");
    if (::mkdtemp(path.data()) == nullptr) {
      return StatusFromErrno(errno, absl::StrCat("creating a folder ", path,
                                                 " (TMPDIR or --keep-state choose another)"));
    }
    return std::unique_ptr<StateDirectory>(new StateDirectory(path, false));
  }
  ~StateDirectory() {
    std::error_code ignored;  // Left-overs in a temporary folder are no error of the picture.
    if (!kept_) std::filesystem::remove_all(path_, ignored);
  }
  StateDirectory(const StateDirectory&) = delete;
  StateDirectory& operator=(const StateDirectory&) = delete;
  const std::string& path() const { return path_; }

 private:
  StateDirectory(std::string path, bool kept) : path_(std::move(path)), kept_(kept) {}
  const std::string path_;
  const bool kept_;
};

// How long the worker in this process may take to report before the progress line goes without it.
constexpr absl::Duration kWorkerReportWait = absl::Seconds(2);

// The first progress line shall not say that no worker is connected: waits for the one that is just
// starting.
void AwaitWorker(const coordinator::FarmView& farm) {
  const absl::Time deadline = absl::Now() + kWorkerReportWait;
  while (true) {
    const uint64_t seen = farm.ChangeCount();
    const absl::Duration rest = deadline - absl::Now();
    if (!farm.ListWorkers().empty() || rest <= absl::ZeroDuration()) return;
    farm.WaitForChange(seen, rest);
  }
}

class RenderCommand : public Command {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = app->add_subcommand("render", "Render a scene in this process");
    AddJobOptions(command, &arguments_);
    AddJsonFlag(command, &json_);
    command->add_option("--threads", worker_.thread_count, "Threads; 0: all processors")
        ->check(CLI::Range(0, 4096))
        ->capture_default_str();
    command->add_option("--http", http_,
                        "Serve the page that shows the picture growing, HOST:PORT");
    command->add_option("--keep-state", keep_state_,
                        "Keep finished work in this folder; the same command goes on from there");
    command
        ->add_option("--scene-memory-max", worker_.scene_memory_bytes_max,
                     "Limit of memory for scenes, e.g. 4G (default 4G)")
        ->transform(CLI::AsSizeValue(false));
    command
        ->add_option("--texture-memory-max", worker_.texture_memory_bytes_max,
                     "Limit of memory for texture tiles, e.g. 512M (default 512M)")
        ->transform(CLI::AsSizeValue(false));
    command->footer(
        "Examples:\n"
        "  sheaf render room.pbrt -o room.exr --png room.png\n"
        "  sheaf render room.pbrt --samples 16 --crop 200,80,456,272 -o detail.png\n"
        "  sheaf render room.pbrt --samples 4096 --keep-state room.state -o room.exr");
    return command;
  }

  ExitCode Run() override {
    if (absl::Status status = CheckJobArguments(arguments_); !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    const Interruption interruption;
    SetLogName("sheaf render");
    SetLogLevel(LogLevel::kWarning);  // The progress line tells the rest.
    const absl::StatusOr<PreparedJob> job = PrepareJob(arguments_);
    if (!job.ok()) return ReportSceneError(job.status());
    for (const std::string& text : job->diagnostics) std::fprintf(stderr, "%s\n", text.c_str());

    const absl::StatusOr<std::unique_ptr<StateDirectory>> state = StateDirectory::Open(keep_state_);
    if (!state.ok()) return ReportError(ExitCode::kFile, state.status());
    coordinator::CoordinatorOptions options;
    options.farm.state_directory = (*state)->path();
    if (keep_state_.empty()) options.farm.kept_parts_bytes_max = 0;
    options.listen_address.clear();
    options.http_address = http_;
    const absl::StatusOr<std::unique_ptr<coordinator::CoordinatorServer>> server =
        coordinator::CoordinatorServer::Start(options);
    if (!server.ok()) return ReportError(ExitCode::kFile, server.status());
    if (!http_.empty()) {
      std::fprintf(stderr, "sheaf: watch at %s\n", (*server)->http_url().c_str());
    }
    worker_.cache_directory = absl::StrCat((*state)->path(), "/cache");
    worker_.grace = std::chrono::milliseconds(0);
    return RenderOn(server->get(), *job, interruption);
  }

 private:
  ExitCode RenderOn(coordinator::CoordinatorServer* server, const PreparedJob& job,
                    const Interruption& interruption) {
    const std::shared_ptr<grpc::Channel> channel = server->InProcessChannel();
    FarmClient client(channel, "this process", interruption.token());
    if (absl::Status status = UploadMissing(&client, job); !status.ok()) {
      return ReportCallError(status);
    }
    v1::CreateJobRequest request = MakeCreateJobRequest(arguments_, job);
    if (!keep_state_.empty()) request.set_request_id(RepeatableRequestId(request));
    const absl::StatusOr<v1::Job> created = client.CreateJob(request);
    if (!created.ok()) return ReportCallError(created.status());

    const absl::StatusOr<std::unique_ptr<worker::EmbeddedWorker>> worker =
        worker::EmbeddedWorker::Open(channel, worker_);
    if (!worker.ok()) return ReportError(ExitCode::kFile, worker.status());
    std::jthread working([&worker](std::stop_token stop) {
      if (absl::Status status = (*worker)->Run(stop); !status.ok()) {
        LogWarning(std::string(status.message()));
      }
    });
    AwaitWorker(server->farm());
    const absl::StatusOr<v1::Job> ended = FollowJob(&client, created->name(), json_);
    if (absl::IsCancelled(ended.status())) {
      std::fprintf(stderr, keep_state_.empty()
                               ? "sheaf: interrupted\n"
                               : "sheaf: interrupted; the same command goes on from here\n");
      return ExitCode::kInterrupted;
    }
    if (!ended.ok()) return ReportCallError(ended.status());
    if (ended->state() == v1::Job::STATE_SUCCEEDED) {
      const absl::Status saved = SavePictures(&client, *ended, OutputPaths(arguments_, job));
      if (!saved.ok()) return ReportError(ExitCode::kFile, saved);
    }
    return ReportEnd(*ended, /*pictures_written=*/true);
  }

  // The same command makes the same job, so that a second run finds what the first one left.
  static std::string RepeatableRequestId(v1::CreateJobRequest request) {
    request.clear_request_id();
    const std::string hex = Sha256Hex(request.SerializeAsString());
    return absl::StrCat(hex.substr(0, 8), "-", hex.substr(8, 4), "-4", hex.substr(13, 3), "-8",
                        hex.substr(17, 3), "-", hex.substr(20, 12));
  }

  JobArguments arguments_;
  worker::WorkerOptions worker_;
  std::string http_, keep_state_;
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> MakeRenderCommand() { return std::make_unique<RenderCommand>(); }

}  // namespace sheaf::cli
