// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The figures of users in /metrics: what their live jobs have taken.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// Users that /metrics tells of one by one, those of most CPU time; the rest together is kOther.
inline constexpr size_t kUserMetricsMax = 50;
inline constexpr char kOther[] = "other";

struct UserFigures {
  double jobs = 0, samples = 0, cpu_seconds = 0;
};

// Adds the figures, at most kUserMetricsMax + 1 values of each name.
void AddUserMetrics(const std::map<std::string, UserFigures>& users,
                    std::vector<MetricView>* metrics);

}  // namespace sheaf::coordinator
