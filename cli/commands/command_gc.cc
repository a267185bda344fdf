// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf gc: makes the coordinator remove items that it no longer keeps, or list them.
#include <cstdint>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "cli/commands/farm_command.h"
#include "cli/progress_line.h"
#include "common/base/printable.h"

namespace sheaf::cli {
namespace {

using Json = nlohmann::ordered_json;

// "parts of jobs/7", "jobs/7 with its images", "12 blobs".
std::string NameOf(const v1::Removal& removal) {
  if (removal.job_name().empty()) {
    return absl::StrCat(removal.item_count(), " ", removal.kind(),
                        removal.item_count() == 1 ? "" : "s");
  }
  if (removal.kind() == "job") return absl::StrCat(removal.job_name(), " with its images");
  return absl::StrCat(removal.kind(), " of ", removal.job_name());
}

class GcCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command = AddCommon(app, "gc", "Remove data that the coordinator no longer keeps");
    command->add_flag("--dry-run", dry_run_, "Only print the removals, and why");
    command->footer(
        "Examples:\n"
        "  sheaf gc --dry-run\n"
        "  sheaf gc --json\n"
        "The coordinator does this by itself. Its options --keep-parts, --keep-jobs,\n"
        "--disk-limit and --disk-free-min, and sheaf pin, set the limits. Needs the role\n"
        "operate.");
    return command;
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    const absl::StatusOr<v1::CollectGarbageResponse> response = client->CollectGarbage(dry_run_);
    if (!response.ok()) return ReportCallError(response.status());
    uint64_t bytes = 0;
    for (const v1::Removal& removal : response->removals()) bytes += removal.size_bytes();
    if (json()) {
      PrintJson(*response, bytes);
      return ExitCode::kOk;
    }
    for (const v1::Removal& removal : response->removals()) {
      std::printf("%10s  %s: %s\n", FormatCount(static_cast<double>(removal.size_bytes())).c_str(),
                  NameOf(removal).c_str(), Printable(removal.reason()).c_str());
    }
    std::printf("%s %llu bytes\n", dry_run_ ? "would remove" : "removed",
                static_cast<unsigned long long>(bytes));
    return ExitCode::kOk;
  }

 private:
  void PrintJson(const v1::CollectGarbageResponse& response, uint64_t bytes) const {
    Json removals = Json::array();
    for (const v1::Removal& removal : response.removals()) {
      removals.push_back({{"kind", removal.kind()},
                          {"job", removal.job_name().empty() ? Json() : Json(removal.job_name())},
                          {"reason", removal.reason()},
                          {"item_count", removal.item_count()},
                          {"size_bytes", removal.size_bytes()}});
    }
    const Json json = {{"dry_run", dry_run_}, {"size_bytes", bytes}, {"removals", removals}};
    std::printf("%s\n", json.dump().c_str());
  }

  bool dry_run_ = false;
};

}  // namespace

std::unique_ptr<Command> MakeGcCommand() { return std::make_unique<GcCommand>(); }

}  // namespace sheaf::cli
