// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// sheaf usage: the usage of a farm by user, show or job, and users' stored bytes.
#include <cstdint>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "cli/commands/farm_command.h"
#include "cli/message.h"
#include "cli/progress_line.h"
#include "common/base/printable.h"
#include "common/command_line/command_line.h"
#include "coordinator/core/policy/owner_bytes.h"
#include "coordinator/core/policy/usage.h"

namespace sheaf::cli {
namespace {

using Json = nlohmann::ordered_json;

std::string Count(uint64_t value) { return FormatCount(static_cast<double>(value)); }

// The row in the form of the coordinator's functions.
coordinator::UsageSum SumOf(const v1::UsageRow& row) {
  coordinator::UsageSum sum;
  const absl::StatusOr<int64_t> day = coordinator::ParseUsageDay(row.day());
  if (day.ok()) sum.day = *day;
  sum.user = Printable(row.user());
  sum.show = Printable(row.show());
  sum.job = Printable(row.job());
  coordinator::Usage& usage = sum.usage;
  usage.result_count = row.result_count();
  usage.sample_count = row.sample_count();
  usage.ray_count = row.ray_count();
  usage.cpu_duration = absl::Seconds(row.cpu_seconds());
  usage.repeated_count = row.repeated_count();
  usage.repeated_cpu_duration = absl::Seconds(row.repeated_cpu_seconds());
  usage.lost_count = row.lost_count();
  usage.lost_cpu_duration = absl::Seconds(row.lost_cpu_seconds());
  usage.upload_bytes = row.upload_bytes();
  usage.part_bytes = row.part_bytes();
  usage.image_bytes = row.image_bytes();
  return sum;
}

Json RowJson(const v1::UsageRow& row) {
  return {{"day", row.day().empty() ? Json() : Json(row.day())},
          {"user", row.user()},
          {"show", row.show()},
          {"job", row.job()},
          {"result_count", row.result_count()},
          {"sample_count", row.sample_count()},
          {"ray_count", row.ray_count()},
          {"cpu_seconds", row.cpu_seconds()},
          {"repeated_count", row.repeated_count()},
          {"repeated_cpu_seconds", row.repeated_cpu_seconds()},
          {"lost_count", row.lost_count()},
          {"lost_cpu_seconds", row.lost_cpu_seconds()},
          {"upload_bytes", row.upload_bytes()},
          {"part_bytes", row.part_bytes()},
          {"image_bytes", row.image_bytes()}};
}

Json StoredJson(const v1::StoredBytes& stored) {
  return {{"user", stored.user()},
          {"total_bytes", stored.total_bytes()},
          {"bytes_max", stored.limit_bytes() == 0 ? Json() : Json(stored.limit_bytes())},
          {"part_bytes", stored.part_bytes()},
          {"image_bytes", stored.image_bytes()},
          {"preview_bytes", stored.preview_bytes()},
          {"content_bytes", stored.content_bytes()}};
}

class UsageCommand : public FarmCommand {
 public:
  CLI::App* AddTo(CLI::App* app) override {
    CLI::App* command =
        AddCommon(app, "usage", "Print the usage of the farm, and users' stored bytes");
    command->add_option("--by", by_, "A row for each user, show or job")
        ->check(IsOneOf({"user", "show", "job"}))
        ->capture_default_str();
    command->add_option("--since", since_, "The first day in UTC, e.g. 2026-05-04")
        ->type_name("DATE");
    command->add_option("--until", until_, "The last day, included")->type_name("DATE");
    command->add_flag("--daily", daily_, "A row for each day");
    command->add_flag("--csv", csv_, "Print the rows as CSV");
    command->footer(
        "Examples:\n"
        "  sheaf usage\n"
        "  sheaf usage --by show --since 2026-05-01 --until 2026-05-31 --csv\n"
        "With the role operate it covers all users, otherwise only you. Repeated and lost work is "
        "a\npart of the CPU time. The coordinator keeps 400 days.");
    return command;
  }

 protected:
  ExitCode RunWith(FarmClient* client) override {
    if (csv_ && json()) {
      return ReportError(ExitCode::kUsage,
                         absl::InvalidArgumentError("give --csv or --json, not both"));
    }
    v1::ListUsageRequest request;
    request.set_by(by_);
    request.set_since_day(since_);
    request.set_until_day(until_);
    request.set_daily(daily_);
    const absl::StatusOr<v1::ListUsageResponse> response = client->ListUsage(request);
    if (!response.ok()) return ReportCallError(response.status());
    if (csv_) {
      std::vector<coordinator::UsageSum> sums;
      for (const v1::UsageRow& row : response->rows()) sums.push_back(SumOf(row));
      std::fputs(coordinator::UsageCsv(sums).c_str(), stdout);
    } else if (json()) {
      PrintJson(*response);
    } else {
      PrintTable(*response);
    }
    return ExitCode::kOk;
  }

 private:
  static void PrintJson(const v1::ListUsageResponse& response) {
    Json rows = Json::array(), stored = Json::array();
    for (const v1::UsageRow& row : response.rows()) rows.push_back(RowJson(row));
    for (const v1::StoredBytes& of : response.stored()) stored.push_back(StoredJson(of));
    const Json json = {{"usage", rows}, {"stored", stored}};
    std::printf("%s\n", json.dump(-1, ' ', false, Json::error_handler_t::replace).c_str());
  }

  std::string NameOf(const v1::UsageRow& row) const {
    if (by_ == "job") return absl::StrCat(row.job(), " of ", row.user());
    if (by_ == "user") return row.user();
    return row.show().empty() ? "(no show)" : row.show();
  }

  void PrintTable(const v1::ListUsageResponse& response) const {
    std::printf("%-10s  %-28s %12s %9s %9s %9s %9s %9s %9s\n", "day", by_.c_str(), "CPU hours",
                "samples", "rays", "repeated", "lost", "uploaded", "stored");
    for (const v1::UsageRow& row : response.rows()) {
      const auto percent = [&row](double seconds) {
        const double fraction = row.cpu_seconds() > 0 ? seconds / row.cpu_seconds() : 0;
        return absl::StrFormat("%.1f%%", 100 * fraction);
      };
      std::printf("%-10s  %-28s %12.3f %9s %9s %9s %9s %9s %9s\n", row.day().c_str(),
                  Printable(NameOf(row)).c_str(), row.cpu_seconds() / 3600,
                  Count(row.sample_count()).c_str(), Count(row.ray_count()).c_str(),
                  percent(row.repeated_cpu_seconds()).c_str(),
                  percent(row.lost_cpu_seconds()).c_str(), Count(row.upload_bytes()).c_str(),
                  Count(row.part_bytes() + row.image_bytes()).c_str());
    }
    if (response.stored().empty()) return;
    std::printf("\nkept now:\n");
    for (const v1::StoredBytes& stored : response.stored()) {
      const coordinator::OwnerBytes bytes = {stored.content_bytes(), stored.part_bytes(),
                                             stored.image_bytes(), stored.preview_bytes()};
      const std::string limit = stored.limit_bytes() == 0
                                    ? std::string()
                                    : " of " + coordinator::FormatBytes(stored.limit_bytes());
      std::printf("%s: %s%s: %s\n", Printable(stored.user()).c_str(),
                  coordinator::FormatBytes(stored.total_bytes()).c_str(), limit.c_str(),
                  coordinator::DescribeBytes(bytes).c_str());
    }
  }

  std::string by_ = "user", since_, until_;
  bool daily_ = false, csv_ = false;
};

}  // namespace

std::unique_ptr<Command> MakeUsageCommand() { return std::make_unique<UsageCommand>(); }

}  // namespace sheaf::cli
