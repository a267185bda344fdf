// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Metrics of this process, under Prometheus' names (Prometheus documentation, "Writing client
// libraries", process metrics). Read from /proc; omits values that the system does not report.
#pragma once

#include <vector>

#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// process_cpu_seconds_total, process_resident_memory_bytes, process_open_fds, process_max_fds and
// process_start_time_seconds.
void AddProcessFigures(std::vector<MetricView>* metrics);

}  // namespace sheaf::coordinator
