// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/profile/load_report.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sheaf::cli {
namespace {

std::string Row(const std::string& name, double wall_seconds, double cpu_seconds) {
  return absl::StrFormat("  %-12s %8.3f %8.3f\n", name, wall_seconds, cpu_seconds);
}

}  // namespace

std::string FormatLoadTimes(const LoadTimes& times) {
  std::string text = absl::StrFormat("  %-12s %8s %8s\n", "phase", "wall s", "CPU s");
  for (size_t i = 0; i < kLoadPhaseCount; ++i) {
    const PhaseTime& phase = times.phases[i];
    if (phase.count == 0) continue;
    absl::StrAppend(&text, Row(LoadPhaseName(static_cast<LoadPhase>(i)), phase.wall_seconds,
                               phase.cpu_seconds));
  }
  absl::StrAppend(&text, Row("other", times.OtherWallSeconds(), times.OtherCpuSeconds()));
  if (times.OverlapWallSeconds() >= 0.0005) {
    absl::StrAppend(&text, Row("counted twice", -times.OverlapWallSeconds(), 0));
  }
  absl::StrAppend(&text, Row("process", times.process.wall_seconds, times.process.cpu_seconds));
  if (times.first_sample.wall_seconds > 0) {
    absl::StrAppendFormat(&text, "first sample after %.3f s, %.3f CPU s\n",
                          times.first_sample.wall_seconds, times.first_sample.cpu_seconds);
  }
  return text;
}

nlohmann::ordered_json LoadTimesJson(const LoadTimes& times) {
  nlohmann::ordered_json json = {{"phases", nlohmann::ordered_json::array()},
                                 {"other_wall_seconds", times.OtherWallSeconds()},
                                 {"other_cpu_seconds", times.OtherCpuSeconds()},
                                 {"overlap_wall_seconds", times.OverlapWallSeconds()},
                                 {"wall_seconds", times.process.wall_seconds},
                                 {"cpu_seconds", times.process.cpu_seconds}};
  for (size_t i = 0; i < kLoadPhaseCount; ++i) {
    const PhaseTime& phase = times.phases[i];
    if (phase.count == 0) continue;
    json["phases"].push_back({{"name", LoadPhaseName(static_cast<LoadPhase>(i))},
                              {"wall_seconds", phase.wall_seconds},
                              {"cpu_seconds", phase.cpu_seconds},
                              {"count", phase.count}});
  }
  if (times.first_sample.wall_seconds > 0) {
    json["first_sample_wall_seconds"] = times.first_sample.wall_seconds;
    json["first_sample_cpu_seconds"] = times.first_sample.cpu_seconds;
  }
  return json;
}

}  // namespace sheaf::cli
