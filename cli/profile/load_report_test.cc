// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/profile/load_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

LoadTimes Times() {
  LoadTimes times;
  times.phases[static_cast<size_t>(LoadPhase::kRead)] = {0.25, 0.125, 1};
  times.phases[static_cast<size_t>(LoadPhase::kTracer)] = {0.5, 0.75, 2};
  times.covered_wall_seconds = 0.7;
  times.process = {1, 1};
  times.first_sample = {0.875, 0.9};
  return times;
}

TEST(LoadReportTest, SumsUpToTheProcess) {
  const std::string text = FormatLoadTimes(Times());
  EXPECT_THAT(text, HasSubstr("  ray tracer      0.500    0.750\n"));
  EXPECT_THAT(text, HasSubstr("  other           0.300    0.125\n"));
  EXPECT_THAT(text, HasSubstr("  counted twice   -0.050    0.000\n"));
  EXPECT_THAT(text, HasSubstr("  process         1.000    1.000\n"));
  EXPECT_THAT(text, HasSubstr("first sample after 0.875 s, 0.900 CPU s\n"));
  EXPECT_THAT(text, Not(HasSubstr("meshes"))) << "the process was never in that phase";
}

TEST(LoadReportTest, TheJsonHasThePhasesThatWere) {
  const nlohmann::ordered_json json = LoadTimesJson(Times());
  ASSERT_EQ(json["phases"].size(), 2u);
  EXPECT_EQ(json["phases"][1]["name"], "ray tracer");
  EXPECT_EQ(json["phases"][1]["count"], 2);
  double wall_seconds = json["other_wall_seconds"], cpu_seconds = json["other_cpu_seconds"];
  for (const auto& phase : json["phases"]) {
    wall_seconds += phase["wall_seconds"].get<double>();
    cpu_seconds += phase["cpu_seconds"].get<double>();
  }
  EXPECT_NEAR(wall_seconds - json["overlap_wall_seconds"].get<double>(), 1, 1e-12);
  EXPECT_NEAR(cpu_seconds, 1, 1e-12);
  EXPECT_FALSE(LoadTimesJson(LoadTimes()).contains("first_sample_wall_seconds"));
}

}  // namespace
}  // namespace sheaf::cli
