// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/policy/usage.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "absl/time/civil_time.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {
namespace {

constexpr absl::CivilDay kFirstDay(1970, 1, 1);

std::string JobNameOf(uint64_t job_id) {
  if (job_id == 0) return "uploads";
  return IsPilot(job_id) ? "pilots" : absl::StrCat("jobs/", job_id);
}

std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  return absl::StrCat("\"", absl::StrReplaceAll(text, {{"\"", "\"\""}}), "\"");
}

}  // namespace

Usage& Usage::operator+=(const Usage& other) {
  result_count += other.result_count;
  sample_count += other.sample_count;
  ray_count += other.ray_count;
  cpu_duration += other.cpu_duration;
  repeated_count += other.repeated_count;
  repeated_cpu_duration += other.repeated_cpu_duration;
  lost_count += other.lost_count;
  lost_cpu_duration += other.lost_cpu_duration;
  upload_bytes += other.upload_bytes;
  part_bytes += other.part_bytes;
  image_bytes += other.image_bytes;
  return *this;
}

std::optional<UsageBy> UsageByFromName(const std::string& name) {
  if (name == "user") return UsageBy::kUser;
  if (name == "show") return UsageBy::kShow;
  if (name == "job") return UsageBy::kJob;
  return std::nullopt;
}

absl::StatusOr<std::vector<UsageSum>> SumUsage(const std::vector<UsageRow>& rows,
                                               const UsageQuery& query) {
  std::map<std::tuple<int64_t, std::string, std::string, std::string>, UsageSum> sums;
  for (const UsageRow& row : rows) {
    if (row.day < query.since_day || row.day > query.until_day) continue;
    if (!query.owner.empty() && row.owner != query.owner) continue;
    UsageSum sum;
    if (query.daily) sum.day = row.day;
    if (query.by != UsageBy::kShow) sum.user = row.owner;
    if (query.by != UsageBy::kUser) sum.show = row.show;
    if (query.by == UsageBy::kJob) sum.job = JobNameOf(row.job_id);
    auto key = std::make_tuple(sum.day.value_or(0), sum.user, sum.show, sum.job);
    sums.emplace(std::move(key), std::move(sum)).first->second.usage += row.usage;
    if (sums.size() > kUsageRowsMax) {
      return absl::InvalidArgumentError(
          absl::StrCat("the answer has more than ", kUsageRowsMax,
                       " rows; ask for fewer days, or by user instead of by job"));
    }
  }
  std::vector<UsageSum> list;
  for (auto& [key, sum] : sums) list.push_back(std::move(sum));
  std::stable_sort(list.begin(), list.end(), [](const UsageSum& a, const UsageSum& b) {
    if (a.day != b.day) return a.day < b.day;
    return a.usage.cpu_duration > b.usage.cpu_duration;
  });
  return list;
}

int64_t UsageDayOf(absl::Time time) {
  return absl::ToCivilDay(time, absl::UTCTimeZone()) - kFirstDay;
}

std::string FormatUsageDay(int64_t day) { return absl::FormatCivilTime(kFirstDay + day); }

absl::StatusOr<int64_t> ParseUsageDay(const std::string& text) {
  absl::CivilDay day;
  if (absl::ParseCivilTime(text, &day)) return day - kFirstDay;
  return absl::InvalidArgumentError(
      absl::StrCat("\"", text, "\" is not a day; write for example 2026-05-04"));
}

absl::StatusOr<UsageQuery> ParseUsageQuery(const std::string& by, const std::string& since,
                                           const std::string& until, bool daily) {
  UsageQuery query;
  query.daily = daily;
  if (!by.empty()) {
    const std::optional<UsageBy> named = UsageByFromName(by);
    if (!named) {
      return absl::InvalidArgumentError(
          absl::StrCat("by \"", by, "\" is not one of user, show and job"));
    }
    query.by = *named;
  }
  for (const auto& [text, day] :
       {std::pair(&since, &query.since_day), std::pair(&until, &query.until_day)}) {
    if (text->empty()) continue;
    const absl::StatusOr<int64_t> parsed = ParseUsageDay(*text);
    if (!parsed.ok()) return parsed.status();
    *day = *parsed;
  }
  if (query.since_day > query.until_day) {
    return absl::InvalidArgumentError(
        absl::StrCat("the days from ", since, " until ", until, " are none: swap them"));
  }
  return query;
}

std::string UsageCsv(const std::vector<UsageSum>& sums) {
  std::string text =
      "day,user,show,job,results,samples,rays,cpu_seconds,repeated_results,repeated_cpu_seconds,"
      "lost_results,lost_cpu_seconds,upload_bytes,part_bytes,image_bytes\n";
  for (const UsageSum& sum : sums) {
    const Usage& usage = sum.usage;
    absl::StrAppend(&text, sum.day ? FormatUsageDay(*sum.day) : "", ",", CsvField(sum.user), ",",
                    CsvField(sum.show), ",", sum.job, ",");
    absl::StrAppend(&text, usage.result_count, ",", usage.sample_count, ",", usage.ray_count, ",",
                    absl::StrFormat("%.3f", absl::ToDoubleSeconds(usage.cpu_duration)), ",",
                    usage.repeated_count, ",",
                    absl::StrFormat("%.3f", absl::ToDoubleSeconds(usage.repeated_cpu_duration)),
                    ",", usage.lost_count, ",",
                    absl::StrFormat("%.3f", absl::ToDoubleSeconds(usage.lost_cpu_duration)), ",");
    absl::StrAppend(&text, usage.upload_bytes, ",", usage.part_bytes, ",", usage.image_bytes, "\n");
  }
  return text;
}

}  // namespace sheaf::coordinator
