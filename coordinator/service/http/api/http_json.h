// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The views of the farm as JSON text. Field names are those of the protos; times are ISO 8601 in
// UTC, durations are in seconds, and null stands for unknown values.
#pragma once

#include <string>
#include <vector>

#include "coordinator/access/identity.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// A job without its frames: one object on one line.
std::string JobJson(const JobView& job);

// One frame of a job.
std::string FrameJson(const std::string& job_id, const FrameView& frame);

// The things that a removal takes.
std::string RemovalJson(const RemovalView& removal);

// One of a job's failures.
std::string FailureJson(const std::string& job_id, const FailureView& view);
std::string WorkerJson(const WorkerView& worker);
// {"name":"jobs/7"}.
std::string NameJson(const std::string& name);

// {"KEY": [objects...], "next_page_token": "..."}.
// Requires: each of `objects` is JSON.
std::string ListJson(const std::string& key, const std::vector<std::string>& objects,
                     const std::string& next_page_token);

std::string RefinementPricesJson(const RefinementPrices& priced);

// The job with {"effect_costs": [...], "frames": [...], "next_page_token": "..."} added.
std::string JobWithFramesJson(const JobView& job, const std::vector<std::string>& frames,
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
