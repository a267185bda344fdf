// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Usage: the resources that jobs have used, by day, user, show and job. The store keeps one row for
// each day of a job, in the transaction that makes a result durable, so that the accounts and the
// parts never disagree ([ADR 76](docs/adr/0076-accounts-with-the-rows.md)). Rows are kept for
// kUsageDaysKept days, also after their jobs are removed. This file has the values and pure
// functions that sum them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sheaf::coordinator {

// Older rows are removed.
inline constexpr int64_t kUsageDaysKept = 400;
// Maximum rows of one answer; a query with more is refused.
inline constexpr size_t kUsageRowsMax = 10'000;
// Usage that is not written with a part (repeated and lost work, uploads) is committed at this
// interval. A crash of the coordinator loses at most that much.
inline constexpr absl::Duration kUsageWriteInterval = absl::Seconds(10);

// Repeated and lost work is a part of the results and of their CPU time.
struct Usage {
  uint64_t result_count = 0;  // Results that workers delivered.
  uint64_t sample_count = 0;  // Their pixel samples and light paths.
  uint64_t ray_count = 0;
  absl::Duration cpu_duration = {};
  // Results of work that was already done: checks and hedges.
  uint64_t repeated_count = 0;
  absl::Duration repeated_cpu_duration = {};
  // Results that are in no image: late, invalid or false ones, and parts that the disk lost.
  uint64_t lost_count = 0;
  absl::Duration lost_cpu_duration = {};
  uint64_t upload_bytes = 0;  // Files of scenes, and images to resume.
  uint64_t part_bytes = 0;    // Stored on that day, even if removed since.
  uint64_t image_bytes = 0;   // Likewise, of delivered EXRs.

  Usage& operator+=(const Usage& other);
  friend bool operator==(const Usage&, const Usage&) = default;
};

// The account of a day, in UTC. Pilots of quotes share one job id, kFirstPilotId; uploads have the
// job id 0 and no show.
struct UsageRow {
  int64_t day = 0;  // Days since 1970-01-01.
  std::string owner, show;
  uint64_t job_id = 0;
  Usage usage;
};

enum class UsageBy { kUser, kShow, kJob };
// "user", "show" or "job"; none for other texts.
std::optional<UsageBy> UsageByFromName(const std::string& name);

struct UsageQuery {
  UsageBy by = UsageBy::kUser;
  int64_t since_day = INT64_MIN, until_day = INT64_MAX;  // Both included.
  bool daily = false;                                    // A row for each day.
  std::string owner = {};                                // Only this user's; empty: all users'.
};

// The sum of several rows. Fields in which they differ are empty.
struct UsageSum {
  std::optional<int64_t> day;  // None: over all days of the query.
  std::string user, show;
  std::string job;  // "jobs/7", "pilots" or "uploads".
  Usage usage;
};

// The sums that the query asks for, ascending by day; within a day, by descending CPU time.
// Errors: kInvalidArgument (more than kUsageRowsMax rows), saying what to do.
absl::StatusOr<std::vector<UsageSum>> SumUsage(const std::vector<UsageRow>& rows,
                                               const UsageQuery& query);

// The day in UTC.
int64_t UsageDayOf(absl::Time time);
// "2026-05-04".
std::string FormatUsageDay(int64_t day);
// Errors: kInvalidArgument.
absl::StatusOr<int64_t> ParseUsageDay(const std::string& text);
// Parses a query from users' texts; empty ones select the defaults. Errors: kInvalidArgument.
absl::StatusOr<UsageQuery> ParseUsageQuery(const std::string& by, const std::string& since,
                                           const std::string& until, bool daily);

// A header and a line for each sum, by RFC 4180 with line feeds alone.
std::string UsageCsv(const std::vector<UsageSum>& sums);

}  // namespace sheaf::coordinator
