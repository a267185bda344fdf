// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JSON of the HTTP port beyond that of views (view/json/view_json.h): lists, accounts, metrics and
// conditions.
#pragma once

#include <string>
#include <vector>

#include "coordinator/access/identity.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/service/view/json/view_json.h"

namespace sheaf::coordinator {

// {"name":"jobs/7"}.
std::string NameJson(const std::string& name);

// {"KEY": [objects...], "next_page_token": "..."}.
// Requires: each of `objects` is JSON.
std::string ListJson(const std::string& key, const std::vector<std::string>& objects,
                     const std::string& next_page_token);

// Counters and gauges: name, help, kind, label_name, label_value, value.
std::string HealthJson();
std::string ReadyJson(const std::vector<ReadyCondition>& conditions);
// The sums, and what users keep.
std::string UsageJson(const UsageReport& report);
std::string MetricJson(const MetricView& metric);

// {"user": ..., "role": ...}; both "" for a caller without an identity.
std::string SessionJson(const Caller& caller);

}  // namespace sheaf::coordinator
