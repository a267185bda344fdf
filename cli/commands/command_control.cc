// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf pause, resume, priority, cancel, pin, unpin, release, retry and kill: commands that change
// an existing job.
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "cli/commands/control_command.h"

namespace sheaf::cli {
namespace {

// A command that names a job, and nothing else.
struct NamedVerb {
  const char* name;
  const char* help;
  const char* footer;
  const char* result;  // Printed after the job's name; empty: its state.
  absl::StatusOr<v1::Job> (*change)(FarmClient* client, const std::string& job_name);
};

#define SHEAF_CHANGE(call)                                        \
  [](FarmClient* client, const std::string& job_name) {           \
    return client->call(RequestFor<v1::call##Request>(job_name)); \
  }

constexpr NamedVerb kCancel = {"cancel", "Cancel a job", "Example:\n  sheaf cancel jobs/7", "",
                               SHEAF_CHANGE(CancelJob)};
constexpr NamedVerb kPause = {
    "pause", "Pause a job; running tasks finish",
    "Example:\n"
    "  sheaf pause jobs/7\n"
    "The job stays paused, even if the coordinator restarts, until: sheaf resume jobs/7",
    "", SHEAF_CHANGE(PauseJob)};
constexpr NamedVerb kResume = {"resume", "Resume a paused job", "Example:\n  sheaf resume jobs/7",
                               "", SHEAF_CHANGE(ResumeJob)};
constexpr NamedVerb kPin = {
    "pin", "Keep all of a job, however full the coordinator's disk is",
    "Example:\n"
    "  sheaf pin jobs/7\n"
    "Its parts, the files of its scene and its images stay until: sheaf unpin jobs/7",
    "pinned", SHEAF_CHANGE(PinJob)};
constexpr NamedVerb kUnpin = {"unpin", "Undo sheaf pin", "Example:\n  sheaf unpin jobs/7",
                              "not pinned", SHEAF_CHANGE(UnpinJob)};
constexpr NamedVerb kRelease = {
    "release", "Start a job that waits for other jobs",
    "Example:\n"
    "  sheaf release jobs/7\n"
    "Removes the job's dependencies (sheaf submit --after), whatever their state.",
    "released", SHEAF_CHANGE(ReleaseJob)};
#undef SHEAF_CHANGE

class NamedCommand : public ControlCommand {
 public:
  explicit NamedCommand(const NamedVerb& verb) : verb_(verb) {}

  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, verb_.name, verb_.help);
    AddJob(command);
    command->footer(verb_.footer);
    return command;
  }

 protected:
  absl::StatusOr<v1::Job> Change(FarmClient* client) override {
    return verb_.change(client, job_name());
  }
  std::string ResultText(const v1::Job& job) const override {
    return *verb_.result == 0 ? ControlCommand::ResultText(job) : verb_.result;
  }

 private:
  const NamedVerb& verb_;
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
    auto request = RequestFor<v1::SetJobPriorityRequest>(job_name());
    request.set_priority(priority_);
    return client->SetJobPriority(request);
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

}  // namespace

std::vector<std::unique_ptr<Command>> MakeChangeCommands() {
  std::vector<std::unique_ptr<Command>> commands;
  const auto add = [&](const NamedVerb& verb) {
    commands.push_back(std::make_unique<NamedCommand>(verb));
  };
  add(kPause);
  add(kResume);
  commands.push_back(std::make_unique<PriorityCommand>());
  add(kCancel);
  commands.push_back(MakeDeleteCommand());
  add(kRelease);
  commands.push_back(MakeApproveCommand());
  add(kPin);
  add(kUnpin);
  return commands;
}

std::unique_ptr<Command> MakeRetryCommand() { return std::make_unique<RetryCommand>(); }
std::unique_ptr<Command> MakeKillCommand() { return std::make_unique<KillCommand>(); }

}  // namespace sheaf::cli
