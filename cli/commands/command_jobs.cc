// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf watch, list and workers: show the farm's jobs and workers.
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "cli/commands/farm_command.h"
#include "cli/error_text.h"
#include "cli/job/follow_job.h"
#include "cli/job/job_json.h"
#include "cli/message.h"
#include "cli/progress_line.h"
#include "common/base/memory_room.h"
#include "common/base/printable.h"

namespace sheaf::cli {
namespace {

// The share of its leases for which the worker had to load the scene.
std::string ColdShare(const v1::Worker& worker) {
  if (worker.lease_granted_count() == 0) return "-";
  return absl::StrFormat("%.0f %%", 100 * static_cast<double>(worker.lease_cold_count()) /
                                        static_cast<double>(worker.lease_granted_count()));
}

class WatchCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "watch", "Follow a job until it ends; download its images");
    AddJob(command);
    AddImageOptions(command, &arguments_);
    command->footer(
        "Examples:\n"
        "  sheaf watch jobs/7\n"
        "  sheaf watch 7 -o 'out/shot.####.exr'\n"
        "  sheaf watch 7 --json | tail -n 1");
    return command;
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    const absl::StatusOr<ViewTransform> view = OpenView(arguments_);
    if (!view.ok()) return ReportError(ExitCode::kUsage, view.status());
    if (arguments_.output.empty() && arguments_.png.empty() && arguments_.denoise_with.empty()) {
      return FollowToTheEnd(client, job_name(), json(), {});
    }
    if (absl::Status status = CheckImageNames(arguments_); !status.ok()) {
      return ReportError(ExitCode::kUsage, status);
    }
    const absl::StatusOr<v1::Job> job = client->GetJob(job_name());
    if (!job.ok()) return ReportCallError(job.status());
    const absl::StatusOr<Delivery> delivery = MakeDelivery(arguments_, *job, *view);
    if (!delivery.ok()) return ReportOutputError(delivery.status());
    return FollowToTheEnd(client, job_name(), json(), *delivery);
  }

 private:
  JobArguments arguments_;
};

constexpr int kJobsListedMax = 1'000'000;

class ListCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "list", "List jobs, newest first");
    command->add_option("--limit", limit_, "Maximum number of jobs")
        ->check(InRange(1, kJobsListedMax))
        ->capture_default_str();
    AddChoice(command, "--state", &state_,
              std::vector<std::pair<std::string, std::string>>{{"queued", "queued"},
                                                               {"running", "running"},
                                                               {"paused", "paused"},
                                                               {"succeeded", "succeeded"},
                                                               {"failed", "failed"},
                                                               {"cancelled", "cancelled"}},
              "Only jobs in this state");
    command->add_option("--user", user_, "Only jobs of this user")->check(IsText());
    command->add_flag("--all", all_, "Also list the pilots of quotes");
    command->footer(
        "Examples:\n  sheaf list\n  sheaf list --json --limit 10\n  sheaf list --state failed "
        "--user anna");
    return command;
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    // One more than the limit tells whether there are more.
    const auto limit = static_cast<size_t>(limit_);
    const bool is_chosen = !state_.empty() || !user_.empty();
    absl::StatusOr<std::vector<v1::Job>> jobs =
        client->ListJobs(is_chosen ? kJobsListedMax : limit + 1, all_);
    if (!jobs.ok()) return ReportCallError(jobs.status());
    std::erase_if(*jobs, [this](const v1::Job& job) {
      return (!state_.empty() && JobStateName(job.state()) != state_) ||
             (!user_.empty() && job.owner() != user_);
    });
    const bool are_more = jobs->size() > limit;
    if (are_more) jobs->resize(limit);
    if (!json())
      std::printf("%-12s %-10s %7s  %-10s %-12s %-12s %s\n", "JOB", "STATE", "DONE", "ERROR",
                  "OWNER", "SHOW", "TITLE");
    for (const v1::Job& job : *jobs) {
      if (json()) {
        std::printf("%s\n", JobJson(job).c_str());
        continue;
      }
      const double error = job.progress().relative_mse();
      std::printf("%-12s %-10s %6.1f%%  %-11s %-12s %-12s %s\n", job.name().c_str(),
                  JobStateName(job.state()).c_str(), 100 * FractionDone(job.progress()),
                  error > 0 ? FormatPixelError(error).c_str() : "- ",
                  Printable(job.owner()).c_str(), Printable(job.show()).c_str(),
                  absl::StrCat(Printable(job.title()), job.pinned() ? "  (pinned)" : "").c_str());
      if (!job.waiting_reason().empty()) {
        std::printf("  %s\n", PrintableLines(job.waiting_reason()).c_str());
      }
    }
    if (are_more) {
      PrintNote(absl::StrCat("there are older jobs than these ", limit,
                             "; --limit lists more, --state and --user list some"));
    }
    return ExitCode::kOk;
  }

 private:
  int limit_ = 100;
  bool all_ = false;
  std::string state_, user_;
};

// "tags gpu-free, ssd; 60 GiB for scenes": empty if the worker has no tags.
std::string TraitsText(const v1::Worker& worker) {
  if (worker.tags().empty()) return "";
  std::string text = absl::StrCat("tags ", Printable(absl::StrJoin(worker.tags(), ", ")));
  if (worker.memory_bytes() > 0) {
    absl::StrAppend(&text, "; ", FormatMemory(worker.memory_bytes()), " for scenes");
  }
  return text;
}

// A row has at most 100 columns, with a pool's name of up to 12.
constexpr int kWorkerColumns = 31;

bool HaveOneProfile(const std::vector<v1::Worker>& workers) {
  return std::ranges::all_of(workers, [&workers](const v1::Worker& worker) {
    return worker.numeric_profile() == workers.front().numeric_profile();
  });
}

// The name of its certificate, if it has one.
std::string KnownAs(const v1::Worker& worker) {
  const bool is_id = absl::StrCat("workers/", worker.identity()) == worker.name();
  return is_id ? "" : Printable(worker.identity());
}

class WorkersCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "workers", "List the workers the coordinator knows");
    command->add_option("--trust", trusted_,
                        "First lift the quarantine of this worker or certificate");
    command->footer(
        "Examples:\n  sheaf workers\n  sheaf workers --json\n"
        "  sheaf workers --trust render-07");
    return command;
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    if (!trusted_.empty()) {
      if (absl::Status lifted = client->LiftQuarantine(trusted_); !lifted.ok()) {
        return ReportCallError(lifted);
      }
    }
    const absl::StatusOr<std::vector<v1::Worker>> workers = client->ListWorkers();
    if (!workers.ok()) return ReportCallError(workers.status());
    if (!json()) {
      std::printf("%-*s %-11s %7s %6s %8s %6s %9s  %s\n", kWorkerColumns, "WORKER", "STATE",
                  "THREADS", "LEASES", "RESULTS", "COLD", "SAMPLES/S", "POOL");
    }
    const bool are_equal = HaveOneProfile(*workers);
    for (const v1::Worker& worker : *workers) {
      if (json()) {
        std::printf("%s\n", WorkerJson(worker).c_str());
        continue;
      }
      std::string id = Printable(worker.name().substr(worker.name().find('/') + 1));
      if (id.size() > kWorkerColumns) {  // A long one has its own line.
        std::printf("%s\n", id.c_str());
        id.clear();
      }
      std::printf("%-*s %-11s %7d %6d %8llu %6s %9s  %s\n", kWorkerColumns, id.c_str(),
                  WorkerStateName(worker.state()).c_str(), worker.thread_count(),
                  worker.lease_count(), static_cast<unsigned long long>(worker.result_count()),
                  ColdShare(worker).c_str(), FormatCount(worker.samples_per_second()).c_str(),
                  Printable(worker.pool()).c_str());
      if (!are_equal) std::printf("  profile %s\n", worker.numeric_profile().c_str());
      if (const std::string name = KnownAs(worker); !name.empty()) {
        std::printf("  known as %s\n", name.c_str());
      }
      if (const std::string has = TraitsText(worker); !has.empty()) {
        std::printf("  %s\n", has.c_str());
      }
      if (worker.drained()) {
        std::printf("  drained%s; give it work again with sheaf undrain\n",
                    worker.then_exit() ? ", and exits when it holds no leases" : "");
      }
      if (!worker.reason().empty()) {
        std::printf("  %s; lift it with sheaf workers --trust %s\n",
                    Printable(worker.reason()).c_str(), Printable(worker.identity()).c_str());
      }
    }
    return ExitCode::kOk;
  }

 private:
  std::string trusted_;
};

}  // namespace

std::unique_ptr<Command> MakeWatchCommand() { return std::make_unique<WatchCommand>(); }
std::unique_ptr<Command> MakeListCommand() { return std::make_unique<ListCommand>(); }
std::unique_ptr<Command> MakeWorkersCommand() { return std::make_unique<WorkersCommand>(); }

}  // namespace sheaf::cli
