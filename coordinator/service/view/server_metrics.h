// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ServerMetrics: the metrics of the coordinator as a server: its build, its process, and the
// durations of calls.
#pragma once

#include <string>
#include <vector>

#include "coordinator/service/view/call_times.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// The build of a program. Empty texts are unknown.
struct BuildInfo {
  std::string version, revision, compiler, numeric_profile;
};

// Thread safety: all members may be called concurrently.
struct ServerMetrics {
  explicit ServerMetrics(BuildInfo build_info);

  // sheaf_build_info, which is 1 and has the build as labels; process_*; the calls.
  std::vector<MetricView> List() const;

  const BuildInfo build;
  CallTimes grpc_calls{"sheaf_grpc_call_seconds",
                       "Time of gRPC calls by method and code, without refused calls.", "method"};
  CallTimes http_requests{"sheaf_http_request_seconds",
                          "Time until an HTTP request is answered, by route and code, without its "
                          "transfer.",
                          "route"};
};

}  // namespace sheaf::coordinator
