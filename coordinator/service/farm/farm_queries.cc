// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/farm_queries.h"

#include "coordinator/service/farm/queries/object_metrics.h"

namespace sheaf::coordinator {

std::vector<MetricView> FarmQueries::Metrics() const {
  std::vector<MetricView> metrics = parts_.metrics.List();
  parts_.keeper.AddMetrics(&metrics);
  parts_.content.AddMetrics(&metrics);
  if (parts_.scrubber != nullptr) parts_.scrubber->AddMetrics(&metrics);
  if (parts_.objects != nullptr) AddObjectMetrics(*parts_.objects, &metrics);
  return metrics;
}

std::vector<ReadyCondition> FarmQueries::Conditions() const {
  return {{"database", parts_.disk.Last()}, {"disk", parts_.keeper.CheckFreeSpace()}};
}

}  // namespace sheaf::coordinator
