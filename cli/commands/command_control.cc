// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf pause, resume, priority and cancel: commands that change an existing job.
#include <cstdint>
#include <cstdio>
#include <string>

#include "absl/strings/str_cat.h"
#include "cli/commands/farm_command.h"
#include "cli/job/job_json.h"

namespace sheaf::cli {
namespace {

// Changes a job and prints its new state.
class ControlCommand : public FarmCommand {
 protected:
  virtual absl::StatusOr<v1::Job> Change(FarmClient* client) = 0;
  // The text to print after the job's name.
  virtual std::string ResultText(const v1::Job& job) const { return JobStateName(job.state()); }

  ExitCode RunWith(FarmClient* client) override {
    absl::StatusOr<v1::Job> job = Change(client);
    if (job.ok() && json()) job = client->GetJob(job->name());  // Includes its frames.
    if (!job.ok()) return ReportCallError(job.status());
    std::printf("%s\n", json() ? JobJson(*job).c_str()
                               : absl::StrCat(job->name(), " ", ResultText(*job)).c_str());
    return ExitCode::kOk;
  }
};

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
        ->check(CLI::Range(-1000, 1000));
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

}  // namespace

std::unique_ptr<Command> MakeCancelCommand() { return std::make_unique<CancelCommand>(); }
std::unique_ptr<Command> MakePauseCommand() { return std::make_unique<PauseCommand>(); }
std::unique_ptr<Command> MakeResumeCommand() { return std::make_unique<ResumeCommand>(); }
std::unique_ptr<Command> MakePriorityCommand() { return std::make_unique<PriorityCommand>(); }

}  // namespace sheaf::cli
