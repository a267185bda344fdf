// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The values of users in /metrics: the usage of their live jobs.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// Users that /metrics lists individually, by descending CPU time; the rest are summed as kOther.
inline constexpr size_t kUserMetricsMax = 50;
inline constexpr char kOther[] = "other";

struct UserFigures {
  double jobs = 0, samples = 0, cpu_seconds = 0;
};

// Adds the values, at most kUserMetricsMax + 1 of each name.
void AddUserMetrics(const std::map<std::string, UserFigures>& users,
                    std::vector<MetricView>* metrics);

}  // namespace sheaf::coordinator
