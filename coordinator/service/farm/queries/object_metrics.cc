// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/queries/object_metrics.h"

namespace sheaf::coordinator {

void AddObjectMetrics(const ObjectStore& store, std::vector<MetricView>* metrics) {
  const std::optional<ObjectCounts> counts = store.Counts();
  if (!counts) return;
  const auto add = [metrics](const char* name, const char* help, uint64_t value) {
    metrics->push_back(
        {name, help, MetricView::Kind::kCounter, "", "", static_cast<double>(value)});
  };
  add("sheaf_objects_requests_total", "Requests to the object store, with repeated ones.",
      counts->requests);
  add("sheaf_objects_retries_total", "Requests that were repeated.", counts->retries);
  add("sheaf_objects_failures_total", "Requests that failed after all repetitions, or at once.",
      counts->failures);
  add("sheaf_objects_sent_bytes_total", "Bytes of objects sent to the object store.",
      counts->sent_bytes);
  add("sheaf_objects_received_bytes_total", "Bytes of objects received from it.",
      counts->received_bytes);
}

}  // namespace sheaf::coordinator
