// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Views as JSON, by the descriptions of their fields (view_field.h): one object on one line. Times
// are ISO 8601 in UTC, durations are in seconds, and null stands for unknown values.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// Which fields the JSON has: those of the HTTP port, or those of messages, which the command line
// gets.
enum class JsonFields { kHttp, kMessages };

// A job without its frames.
std::string JobJson(const JobView& job, JsonFields fields);
// The same with its effects and these frames. next_page_token: none: the JSON has none.
std::string JobWithFramesJson(const JobView& job, const std::vector<std::string>& frames,
                              JsonFields fields,
                              const std::optional<std::string>& next_page_token = std::nullopt);
// One frame of a job.
std::string FrameJson(const std::string& job_id, const FrameView& frame, JsonFields fields);
std::string WorkerJson(const WorkerView& worker, JsonFields fields);
std::string ShareJson(const ShareView& share);
std::string RefinementPricesJson(const RefinementPrices& priced);
std::string RemovalJson(const RemovalView& removal);
// One of a job's failures.
std::string FailureJson(const std::string& job_id, const FailureView& view);
std::string EventJson(const JobEvent& event);

}  // namespace sheaf::coordinator
