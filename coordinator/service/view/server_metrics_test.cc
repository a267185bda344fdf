// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/server_metrics.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"

namespace sheaf::coordinator {
namespace {

const MetricView* Find(const std::vector<MetricView>& metrics, const std::string& name,
                       const std::string& suffix = "", const std::string& value = "") {
  for (const MetricView& metric : metrics) {
    const bool fits = value.empty() || metric.label_value == value;
    if (metric.name == name && metric.suffix == suffix && fits) return &metric;
  }
  return nullptr;
}

TEST(ServerMetricsTest, NamesTheBuild) {
  const ServerMetrics server(BuildInfo{"1.2", "abc", "gcc 12", "profile"});
  const auto metrics = server.List();
  const MetricView* info = Find(metrics, "sheaf_build_info");
  ASSERT_NE(info, nullptr);
  EXPECT_EQ(info->value, 1);
  EXPECT_EQ(info->label_value, "1.2");
  ASSERT_EQ(info->more_labels.size(), 3u);
  EXPECT_EQ(info->more_labels[0].second, "abc");
}

TEST(ServerMetricsTest, TellsOfTheProcess) {
  const auto metrics = ServerMetrics(BuildInfo{}).List();
  for (const char* name : {"process_cpu_seconds_total", "process_resident_memory_bytes",
                           "process_open_fds", "process_max_fds", "process_start_time_seconds"}) {
    const MetricView* metric = Find(metrics, name);
    ASSERT_NE(metric, nullptr) << name;
    EXPECT_GT(metric->value, 0) << name;
  }
  const double start = Find(metrics, "process_start_time_seconds")->value;
  const double now = absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch());
  EXPECT_LT(start, now + 2);
  EXPECT_GT(start, now - 3600) << "the test began within this hour";
}

TEST(ServerMetricsTest, CountsCallsByWhatAndCode) {
  ServerMetrics server(BuildInfo{});
  server.grpc_calls.Note("JobService/GetJob", "OK", absl::Milliseconds(2));
  server.grpc_calls.Note("JobService/GetJob", "OK", absl::Seconds(100));
  server.grpc_calls.Note("JobService/GetJob", "NOT_FOUND", absl::Milliseconds(2));
  const auto metrics = server.List();
  const MetricView* count = Find(metrics, "sheaf_grpc_call_seconds", "_count", "JobService/GetJob");
  ASSERT_NE(count, nullptr);
  EXPECT_EQ(count->more_labels[0].second, "NOT_FOUND") << "ascending";
  std::set<double> buckets;
  for (const MetricView& metric : metrics) {
    if (metric.suffix != "_bucket" || metric.label_value != "JobService/GetJob") continue;
    ASSERT_EQ(metric.more_labels.size(), 2u);
    if (metric.more_labels[0].second == "OK") buckets.insert(metric.value);
  }
  EXPECT_EQ(buckets, (std::set<double>{0, 1, 2}));
  EXPECT_NE(Find(metrics, "sheaf_grpc_call_seconds", "_count", "WorkerService/Synchronize"),
            nullptr)
      << "before its first call, too";
}

TEST(ServerMetricsTest, CallsOfManyKindsAreOther) {
  CallTimes times("calls", "Calls.", "method");
  for (size_t i = 0; i < 2 * kCallSeriesMax; ++i) {
    times.Note(absl::StrCat("method", i), "OK", absl::Milliseconds(1));
  }
  std::vector<MetricView> metrics;
  times.AddMetrics(&metrics);
  size_t series = 0;
  double calls = 0;
  for (const MetricView& metric : metrics) {
    if (metric.suffix != "_count") continue;
    ++series;
    calls += metric.value;
  }
  EXPECT_EQ(series, kCallSeriesMax);
  EXPECT_EQ(calls, 2 * kCallSeriesMax);
  EXPECT_NE(Find(metrics, "calls", "_count", "other"), nullptr);
}

}  // namespace
}  // namespace sheaf::coordinator
