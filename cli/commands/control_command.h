// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ControlCommand: the common base of commands that change an existing job and print its new state.
#pragma once

#include <cstdio>
#include <string>

#include "absl/strings/str_cat.h"
#include "cli/commands/farm_command.h"
#include "cli/job/job_json.h"

namespace sheaf::cli {

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

}  // namespace sheaf::cli
