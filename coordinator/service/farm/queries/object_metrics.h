// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The values in /metrics about the object store's server.
#pragma once

#include <vector>

#include "common/objects/object_store.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// Adds nothing for a store that has no server.
void AddObjectMetrics(const ObjectStore& store, std::vector<MetricView>* metrics);

}  // namespace sheaf::coordinator
