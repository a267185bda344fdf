// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf pause, resume, priority, cancel, pin, unpin, retry and kill: commands that change an
// existing job.
#include <cstdint>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "cli/commands/control_command.h"

namespace sheaf::cli {
namespace {

class CancelCommand : public ControlCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "cancel", "Cancel a job");
    AddJob(command);
    command->footer("Example:\n  sheaf cancel jobs/7");
    return command;
  }

 protected:
  absl::StatusOr<v1::Job> Change(FarmClient* client) override {
    return client->CancelJob(job_name());
  }
};

class PauseCommand : public ControlCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "pause", "Pause a job; running tasks finish");
    AddJob(command);
    command->footer(
        "Example:\n"
        "  sheaf pause jobs/7\n"
        "The job stays paused, even if the coordinator restarts, until: sheaf resume jobs/7");
    return command;
  }

 protected:
  absl::StatusOr<v1::Job> Change(FarmClient* client) override {
    return client->PauseJob(job_name());
  }
};

class ResumeCommand : public ControlCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "resume", "Resume a paused job");
    AddJob(command);
    command->footer("Example:\n  sheaf resume jobs/7");
    return command;
  }

 protected:
  absl::StatusOr<v1::Job> Change(FarmClient* client) override {
    return client->ResumeJob(job_name());
  }
};

class PriorityCommand : public ControlCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "priority", "Set the priority of a job");
    AddJob(command);
    command->add_option("N", priority_, "Higher values run first")
        ->required()
        ->check(InRange(-1000, 1000));
    command->footer(
        "Examples:\n"
        "  sheaf priority jobs/7 10\n"
        "  sheaf priority 7 -5");
    return command;
  }

 protected:
  absl::StatusOr<v1::Job> Change(FarmClient* client) override {
    return client->SetJobPriority(job_name(), priority_);
  }
  std::string ResultText(const v1::Job& job) const override {
    return absl::StrCat("priority ", job.priority());
  }

 private:
  int32_t priority_ = 0;
};

class RetryCommand : public ControlCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "retry", "Retry the failed work of a job, even if the job has failed");
    AddJob(command);
    CLI::Option* frame = command->add_option("--frame", frame_, "Only this frame");
    command->add_option("--task", task_, "Only this task of the frame, as sheaf show numbers them")
        ->needs(frame);
    command->footer(
        "Examples:\n"
        "  sheaf retry jobs/7\n"
        "  sheaf retry 7 --frame 12 --task 3\n"
        "This clears failures, so that workers get the tasks again that they failed. Kept\nresults "
        "are not rendered again.");
    return command;
  }

 protected:
  absl::StatusOr<v1::Job> Change(FarmClient* client) override {
    v1::RetryTasksRequest request;
    request.set_name(job_name());
    if (frame_) request.set_frame_number(*frame_);
    if (task_) request.set_task(*task_);
    return client->RetryTasks(request);
  }

 private:
  std::optional<int32_t> frame_;
  std::optional<uint32_t> task_;
};

class KillCommand : public ControlCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "kill", "Give up a frame or a task of a job; the rest continues");
    AddJob(command);
    command->add_option("--frame", frame_, "The frame")->required();
    command->add_option("--task", task_,
                        "The task: the number of a tile, row by row from 0 (default: the frame)");
    command->footer(
        "Examples:\n"
        "  sheaf kill jobs/7 --frame 12\n"
        "  sheaf kill 7 --frame 12 --task 3\n"
        "The frame gets no image until: sheaf retry jobs/7. To end a whole job: sheaf cancel.");
    return command;
  }

 protected:
  absl::StatusOr<v1::Job> Change(FarmClient* client) override {
    v1::KillTasksRequest request;
    request.set_name(job_name());
    request.set_frame_number(frame_);
    if (task_) request.set_task(*task_);
    return client->KillTasks(request);
  }

 private:
  int32_t frame_ = 0;
  std::optional<uint32_t> task_;
};

class PinCommand : public ControlCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "pin", "Keep all of a job, however full the coordinator's disk is");
    AddJob(command);
    command->footer(
        "Example:\n"
        "  sheaf pin jobs/7\n"
        "Its parts, the files of its scene and its images stay until: sheaf unpin jobs/7");
    return command;
  }

 protected:
  absl::StatusOr<v1::Job> Change(FarmClient* client) override { return client->PinJob(job_name()); }
  std::string ResultText(const v1::Job&) const override { return "pinned"; }
};

class UnpinCommand : public ControlCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "unpin", "Undo sheaf pin");
    AddJob(command);
    command->footer("Example:\n  sheaf unpin jobs/7");
    return command;
  }

 protected:
  absl::StatusOr<v1::Job> Change(FarmClient* client) override {
    return client->UnpinJob(job_name());
  }
  std::string ResultText(const v1::Job&) const override { return "not pinned"; }
};

}  // namespace

std::unique_ptr<Command> MakePinCommand() { return std::make_unique<PinCommand>(); }
std::unique_ptr<Command> MakeUnpinCommand() { return std::make_unique<UnpinCommand>(); }
std::unique_ptr<Command> MakeCancelCommand() { return std::make_unique<CancelCommand>(); }
std::unique_ptr<Command> MakePauseCommand() { return std::make_unique<PauseCommand>(); }
std::unique_ptr<Command> MakeResumeCommand() { return std::make_unique<ResumeCommand>(); }
std::unique_ptr<Command> MakeRetryCommand() { return std::make_unique<RetryCommand>(); }
std::unique_ptr<Command> MakeKillCommand() { return std::make_unique<KillCommand>(); }
std::unique_ptr<Command> MakePriorityCommand() { return std::make_unique<PriorityCommand>(); }

}  // namespace sheaf::cli
