// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf approve, drain and undrain: commands that approve frames, and drain workers.
#include <cstdio>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "cli/commands/control_command.h"
#include "cli/job/frames/frame_range.h"
#include "common/base/printable.h"

namespace sheaf::cli {
namespace {

class ApproveCommand : public ControlCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "approve", "Render frames to the end that wait for approval");
    AddJob(command);
    command->add_option("--frames", frames_,
                        "Frames such as 1-24 or 3,5 (default: all that wait now)");
    command->footer(
        "Examples:\n"
        "  sheaf approve jobs/7\n"
        "  sheaf approve 7 --frames 1-12\n"
        "For jobs of sheaf submit --approve-after. To look at the images first: sheaf show 7 "
        "--image,\n"
        "or the page. To reject the job: sheaf cancel 7.");
    return command;
  }

  ExitCode Run() override {
    if (!frames_.empty()) {
      absl::StatusOr<std::vector<int32_t>> numbers = ParseFrameRange(frames_);
      if (!numbers.ok()) return ReportError(ExitCode::kUsage, numbers.status());
      numbers_ = *std::move(numbers);
    }
    return FarmCommand::Run();
  }

 protected:
  absl::StatusOr<v1::Job> Change(FarmClient* client) override {
    v1::ApproveFramesRequest request;
    request.set_name(job_name());
    request.mutable_frame_numbers()->Assign(numbers_.begin(), numbers_.end());
    return client->ApproveFrames(request);
  }
  std::string ResultText(const v1::Job& job) const override {
    const int left = job.unapproved_frame_count();
    if (left == 0) return "approved";
    return absl::StrCat("approved; ", left,
                        left == 1 ? " frame still waits" : " frames still wait");
  }

 private:
  std::string frames_;
  std::vector<int32_t> numbers_;
};

// Names workers, and prints their state afterwards.
class WorkerCommand : public FarmCommand {
 protected:
  void AddWorkers(CLI::App* command) {
    command->add_option("WORKER", workers_, "The workers, as sheaf workers lists them")
        ->check(IsText());
    command->add_option("--all-of-host", host_, "All workers of this host that are connected now")
        ->check(IsText());
  }
  // Names without the collection, as users copy them from the list.
  template <typename Request>
  Request MakeRequest() const {
    Request request;
    for (const std::string& worker : workers_) {
      request.add_names(absl::StartsWith(worker, "workers/") ? worker
                                                             : absl::StrCat("workers/", worker));
    }
    request.set_host(host_);
    return request;
  }
  virtual absl::StatusOr<std::vector<v1::Worker>> Change(FarmClient* client) = 0;

  ExitCode RunWith(FarmClient* client) override {
    const absl::StatusOr<std::vector<v1::Worker>> workers = Change(client);
    if (!workers.ok()) return ReportCallError(workers.status());
    for (const v1::Worker& worker : *workers) {
      if (json()) {
        std::printf("%s\n", WorkerJson(worker).c_str());
        continue;
      }
      std::printf("%s %s, %d leases%s\n", Printable(worker.name()).c_str(),
                  WorkerStateName(worker.state()).c_str(), worker.lease_count(),
                  worker.then_exit() ? ", exits when it holds none" : "");
    }
    return ExitCode::kOk;
  }

 private:
  std::vector<std::string> workers_;
  std::string host_;
};

class DrainCommand : public WorkerCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "drain", "Drain workers: they finish their leases and get no further ones");
    AddWorkers(command);
    command->add_flag("--then-exit", then_exit_, "They exit when they hold no leases");
    command->footer(
        "Examples:\n"
        "  sheaf drain render-07-4711-a3f2\n"
        "  sheaf drain --all-of-host render-07 --then-exit\n"
        "This lasts until sheaf undrain, also if the coordinator restarts. Workers that start "
        "later\nare not drained.");
    return command;
  }

 protected:
  absl::StatusOr<std::vector<v1::Worker>> Change(FarmClient* client) override {
    v1::DrainWorkersRequest request = MakeRequest<v1::DrainWorkersRequest>();
    request.set_then_exit(then_exit_);
    return client->DrainWorkers(request);
  }

 private:
  bool then_exit_ = false;
};

class UndrainCommand : public WorkerCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "undrain", "Undo sheaf drain");
    AddWorkers(command);
    command->footer("Example:\n  sheaf undrain --all-of-host render-07");
    return command;
  }

 protected:
  absl::StatusOr<std::vector<v1::Worker>> Change(FarmClient* client) override {
    return client->UndrainWorkers(MakeRequest<v1::UndrainWorkersRequest>());
  }
};

}  // namespace

std::unique_ptr<Command> MakeApproveCommand() { return std::make_unique<ApproveCommand>(); }
std::unique_ptr<Command> MakeDrainCommand() { return std::make_unique<DrainCommand>(); }
std::unique_ptr<Command> MakeUndrainCommand() { return std::make_unique<UndrainCommand>(); }

}  // namespace sheaf::cli
