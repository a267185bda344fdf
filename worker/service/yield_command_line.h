// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The options of sheaf-worker by which it yields to the user of its machine.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "common/command_line/command_line.h"
#include "worker/yield/yielding.h"

namespace sheaf::worker {

struct YieldArguments {
  YieldOptions limits;
  std::optional<int> nice;
  bool by_hours = false;
};

// At which a worker renders that watches the load of other programs, unless --nice says otherwise.
inline constexpr int kNiceWithYieldLoad = 10;

// Requires: arguments outlives app.
void AddYieldOptions(CLI::App* app, YieldArguments* arguments);

// Lowers the priority of this process, as its arguments say. Call before any other thread exists:
// threads inherit it. Errors: kInvalidArgument (--yield-load with --nice 0); kPermissionDenied
// (this process has a lower priority already).
absl::Status ApplyNice(const YieldArguments& arguments);

// AgentOptions::why_away by these arguments, this machine's clock and /proc; null where they limit
// nothing.
std::function<std::string(uint64_t scene_bytes)> WhyAwayBy(const YieldArguments& arguments);

}  // namespace sheaf::worker
