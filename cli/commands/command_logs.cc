// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf logs: what happened to a job; and sheaf delete, which ends its history.
#include <cstdio>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/time.h"
#include "cli/commands/farm_command.h"
#include "cli/job/job_json.h"
#include "common/base/mutex.h"
#include "common/base/printable.h"
#include "common/base/surroundings/local_time.h"

namespace sheaf::cli {
namespace {

constexpr absl::Duration kFollowInterval = absl::Seconds(1);

bool HasEnded(v1::Job::State state) {
  return state == v1::Job::STATE_SUCCEEDED || state == v1::Job::STATE_FAILED ||
         state == v1::Job::STATE_CANCELLED;
}

// "2026-05-04 18:00:00  failure    frame 3, workers/a, tile 0,0,16,16, memory: ...".
std::string EventText(const v1::JobEvent& event) {
  const absl::Time time = absl::FromUnixSeconds(event.time().seconds());
  std::string rest;
  const auto add = [&rest](const std::string& part) {
    if (!part.empty()) absl::StrAppend(&rest, rest.empty() ? "" : ", ", part);
  };
  if (event.has_frame_number()) add(absl::StrCat("frame ", event.frame_number()));
  add(event.who());
  add(event.text());
  const std::string start =
      absl::StrCat(absl::FormatTime("%Y-%m-%d %H:%M:%S", time, LocalZone()), "  ");
  const std::string what = Printable(event.what());
  if (rest.empty()) return start + what;
  return absl::StrFormat("%s%-10s %s", start, what, PrintableLines(rest));
}

class LogsCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "logs", "Show what happened to a job, oldest first");
    AddJob(command);
    command->add_option("FRAME", frame_, "Only this frame");
    command->add_flag("--follow", follow_, "Continue with new events until the job has ended");
    command->footer(
        "Examples:\n"
        "  sheaf logs jobs/7\n"
        "  sheaf logs 7 12 --follow\n"
        "  sheaf logs 7 --json | grep '\"failure\"'\n"
        "The acts of users are verbs: submit, pause, retry. Those of the farm are: started (a\n"
        "frame's first task), failure (with the worker and its own message), delivered,\n"
        "succeeded, failed or cancelled. The last 1000 events of a job are kept, and its last "
        "failures.");
    return command;
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    bool has_ended = false;
    while (true) {
      const bool is_last = has_ended || !follow_;
      const absl::StatusOr<std::vector<v1::JobEvent>> events = client->ListJobEvents(job_name());
      if (!events.ok()) return ReportCallError(events.status());
      for (const v1::JobEvent& event : *events) Print(event);
      std::fflush(stdout);
      if (is_last) return ExitCode::kOk;
      const absl::StatusOr<v1::Job> job = client->GetJob(job_name());
      if (!job.ok()) return ReportCallError(job.status());
      has_ended = HasEnded(job->state());
      if (!SleepUnlessStopped(kFollowInterval, client->stop())) {
        return ReportCallError(absl::CancelledError("interrupted"));
      }
    }
  }

 private:
  // Prints an event once.
  void Print(const v1::JobEvent& event) {
    const bool is_chosen = !frame_ || !event.has_frame_number() || event.frame_number() == *frame_;
    if (!is_chosen || (follow_ && !printed_.insert(event.SerializeAsString()).second)) return;
    std::printf("%s\n", json() ? EventJson(event).c_str() : EventText(event).c_str());
  }

  std::optional<int32_t> frame_;
  bool follow_ = false;
  std::set<std::string> printed_;
};

class DeleteCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "delete", "Remove jobs that have ended, with their images on the farm");
    command->add_option("JOB", jobs_, "The jobs, as in jobs/7 or 7")->required()->check(IsText());
    command->add_flag("--cancel", cancel_, "First cancel those that have not ended");
    command->footer(
        "Examples:\n"
        "  sheaf delete jobs/7\n"
        "  sheaf delete 7 8 9 --cancel\n"
        "Its parts, delivered images, previews and log are gone; files that were downloaded stay.\n"
        "Jobs that are pinned, or that another job waits for, are refused.");
    return command;
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    ExitCode code = ExitCode::kOk;
    for (const std::string& job : jobs_) {
      const absl::StatusOr<v1::Job> deleted = Delete(client, JobName(job));
      if (deleted.ok()) {
        std::printf("%s\n", json() ? JobJson(*deleted).c_str()
                                   : absl::StrCat(deleted->name(), " deleted").c_str());
        continue;
      }
      const ExitCode failed = ReportCallError(deleted.status());
      if (code == ExitCode::kOk) code = failed;
    }
    return code;
  }

 private:
  absl::StatusOr<v1::Job> Delete(FarmClient* client, const std::string& name) const {
    absl::StatusOr<v1::Job> job = client->GetJob(name);
    if (!job.ok()) return job.status();
    if (cancel_ && !HasEnded(job->state())) {
      const absl::StatusOr<v1::Job> cancelled =
          client->CancelJob(RequestFor<v1::CancelJobRequest>(name));
      // It may have ended meanwhile.
      if (!cancelled.ok() && !absl::IsFailedPrecondition(cancelled.status())) return cancelled;
    }
    absl::StatusOr<v1::Job> deleted = client->DeleteJob(RequestFor<v1::DeleteJobRequest>(name));
    // A first attempt, whose answer was lost, has deleted it.
    if (absl::IsNotFound(deleted.status())) return job;
    return deleted;
  }

  std::vector<std::string> jobs_;
  bool cancel_ = false;
};

}  // namespace

std::unique_ptr<Command> MakeLogsCommand() { return std::make_unique<LogsCommand>(); }
std::unique_ptr<Command> MakeDeleteCommand() { return std::make_unique<DeleteCommand>(); }

}  // namespace sheaf::cli
