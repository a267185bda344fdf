// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/server_metrics.h"

#include <utility>

#include "coordinator/service/view/process_figures.h"

namespace sheaf::coordinator {

ServerMetrics::ServerMetrics(BuildInfo build_info) : build(std::move(build_info)) {
  // The series that alerts and the dashboard use.
  grpc_calls.Expect("WorkerService/Synchronize", "OK");
  http_requests.Expect("GET /metrics", "200");
}

std::vector<MetricView> ServerMetrics::List() const {
  std::vector<MetricView> metrics;
  MetricView info = {"sheaf_build_info", "The build of the coordinator; always 1.",
                     MetricView::Kind::kGauge, "version", build.version};
  info.more_labels = {{"revision", build.revision},
                      {"compiler", build.compiler},
                      {"numeric_profile", build.numeric_profile}};
  info.value = 1;
  metrics.push_back(std::move(info));
  AddProcessFigures(&metrics);
  grpc_calls.AddMetrics(&metrics);
  http_requests.AddMetrics(&metrics);
  return metrics;
}

}  // namespace sheaf::coordinator
