// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Formats counters and gauges as text for Prometheus. Source: Prometheus documentation, "Exposition
// formats", text format 0.0.4.
#pragma once

#include <string>
#include <vector>

#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

inline constexpr char kPrometheusContentType[] = "text/plain; version=0.0.4; charset=utf-8";

// Requires: metrics of one name are adjacent and share help and kind.
std::string PrometheusText(const std::vector<MetricView>& metrics);

}  // namespace sheaf::coordinator
