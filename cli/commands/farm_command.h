// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmCommand: the common base of commands that call a coordinator.
#pragma once

#include <string>

#include "cli/commands/command.h"
#include "cli/commands/options.h"
#include "cli/interruption.h"
#include "cli/job/farm_channel.h"
#include "cli/job/farm_client.h"
#include "common/command_line/command_line.h"
#include "common/rpc/address.h"

namespace sheaf::cli {

// Adds the options for the coordinator and --json and, for most commands, the job's name.
class FarmCommand : public Command {
 public:
  ExitCode Run() override {
    const Interruption interruption;
    const absl::StatusOr<std::shared_ptr<grpc::Channel>> channel = OpenFarmChannel(coordinator_);
    if (!channel.ok()) return ReportCallError(channel.status());
    FarmClient client(*channel, coordinator_.address, interruption.token());
    return RunWith(&client);
  }

 protected:
  virtual ExitCode RunWith(FarmClient* client) = 0;

  CLI::App* AddCommon(CLI::App* app, const std::string& name, const std::string& help) {
    CLI::App* command = app->add_subcommand(name, help);
    AddCoordinatorOption(command, &coordinator_);
    AddJsonFlag(command, &json_);
    return command;
  }
  void AddJob(CLI::App* command) {
    command->add_option("JOB", job_, "The job, as in jobs/7 or 7")->required()->check(IsText());
  }
  bool json() const { return json_; }
  std::string job_name() const { return JobName(job_); }

 private:
  FarmAddress coordinator_;
  std::string job_;
  bool json_ = false;
};

}  // namespace sheaf::cli
