// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/queries/user_metrics.h"

#include <algorithm>
#include <utility>

namespace sheaf::coordinator {
namespace {

struct UserMetric {
  const char* name;
  const char* help;
  double UserFigures::*value;
};
constexpr UserMetric kUserMetrics[] = {
    {"sheaf_user_jobs", "Live jobs of a user.", &UserFigures::jobs},
    {"sheaf_user_samples", "Pixel samples of a user's live jobs so far.", &UserFigures::samples},
    {"sheaf_user_cpu_seconds", "CPU time of a user's live jobs.", &UserFigures::cpu_seconds},
};

}  // namespace

void AddUserMetrics(const std::map<std::string, UserFigures>& users,
                    std::vector<MetricView>* metrics) {
  std::vector<std::pair<std::string, UserFigures>> shown(users.begin(), users.end());
  std::stable_sort(shown.begin(), shown.end(), [](const auto& a, const auto& b) {
    return a.second.cpu_seconds > b.second.cpu_seconds;
  });
  if (shown.size() > kUserMetricsMax) {
    UserFigures rest;
    for (size_t i = kUserMetricsMax; i < shown.size(); ++i) {
      rest.jobs += shown[i].second.jobs;
      rest.samples += shown[i].second.samples;
      rest.cpu_seconds += shown[i].second.cpu_seconds;
    }
    shown.resize(kUserMetricsMax);
    // A user of that name would give the same series twice.
    const auto named = std::find_if(shown.begin(), shown.end(),
                                    [](const auto& user) { return user.first == kOther; });
    if (named != shown.end()) {
      named->second.jobs += rest.jobs;
      named->second.samples += rest.samples;
      named->second.cpu_seconds += rest.cpu_seconds;
    } else {
      shown.emplace_back(kOther, rest);
    }
  }
  for (const UserMetric& metric : kUserMetrics) {
    for (const auto& [user, figures] : shown) {
      metrics->push_back({metric.name, metric.help, MetricView::Kind::kGauge, "user", user,
                          figures.*metric.value});
    }
  }
}

}  // namespace sheaf::coordinator
