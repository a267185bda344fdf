// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HttpApi's answers to operators of a farm: accounts, readiness and metrics.
#pragma once

#include <vector>

#include "coordinator/service/http/api/http_api.h"

namespace sheaf::coordinator {

// The accounts that the query of the request asks for, as JSON or CSV.
HttpResponse UsageResponse(const FarmActions& actions, const HttpRequest& request);
// Those of the farm, and that the certificates are valid. access: as in HttpApi, also below.
std::vector<ReadyCondition> ConditionsOf(const FarmView& farm, const HttpAccess* access);
// 503 unless all conditions hold.
HttpResponse ReadyResponse(const std::vector<ReadyCondition>& conditions);
// Metrics of the farm and the server, the conditions of readiness, and refusals.
std::vector<MetricView> MetricsOf(const FarmView& farm, const HttpAccess* access,
                                  const ServerMetrics* server);

}  // namespace sheaf::coordinator
